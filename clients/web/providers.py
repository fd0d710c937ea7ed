"""What the pages show that no client knows by itself, the leagues and ladders of a store: whoever starts the server brings it."""

from typing import Any, Protocol


class Leagues(Protocol):
    """The leagues and the ladders of a store, the one that was run last first."""

    def names(self) -> list[str]:
        """Return the names of all leagues; none if there is no store."""

    def report(self, name: str) -> dict[str, Any]:
        """Return the report of a league, as `arena tournament report --json` prints it, its `leaderboard` and `results`."""

    def journal(self, name: str, identity: str) -> bytes:
        """Return the journal of a match, if all of its pair is over."""

    def head_to_head(self, name: str, one: str, other: str) -> dict[str, Any]:
        """Return how two entries of a league fared against each other: the score, by side, by ending, and the matches."""

    def ladders(self) -> list[str]:
        """Return the names of all ladders; none if there is no store."""

    def ladder(self, name: str) -> dict[str, Any]:
        """Return the standings of a ladder, as `arena leaderboard --ladder --json` prints them, and its `leaderboard`."""
