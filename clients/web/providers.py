"""What the pages show that no client knows by itself, leagues, ladders and seasons: whoever starts the server brings it."""

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


class Seasons(Protocol):
    """The seasons of a store, the one that was run last first."""

    def names(self) -> list[str]:
        """Return the names of all seasons; none if there is no store."""

    def season(self, name: str) -> dict[str, Any]:
        """Return the table of a season as it was kept last, and its rows as `leaderboard`."""

    def entry(self, name: str, entry: str) -> dict[str, Any]:
        """Return what everyone may know of an entry of a season: its versions, its last matches, its best and worst opponents."""

    def own(self, name: str, entry: str, token: str, host: str) -> dict[str, Any]:
        """Return what the owner of an entry alone may see of it, to whoever brings the owner's token."""
