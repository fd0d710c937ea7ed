"""What the pages show that a client may not know by itself: the leagues of a store. Whoever starts the server hands it over."""

from typing import Any, Protocol


class Leagues(Protocol):
    """The leagues of a store, the one that was run last first."""

    def names(self) -> list[str]:
        """Return the names of all leagues; none if there is no store."""

    def report(self, name: str) -> dict[str, Any]:
        """Return the report of a league, as `arena tournament report --json` prints it, its `leaderboard` and `results`."""

    def journal(self, name: str, identity: str) -> bytes:
        """Return the journal of a match, if all of its pair is over."""
