"""What the pages show that a client may not know by itself: matches played again, and the leagues of a store.

A client knows neither the rules nor the tournaments. Whoever does offers an entry point of the group `arena.web`:

replay
    `replay(journal: bytes) -> dict`: a match, tick by tick; `ArenaError` if it may not be seen, or is no journal.
warm
    `warm()`: load what `replay` needs. It takes a second; a minute where nothing was ever compiled.
leagues
    `leagues(data: Path, db: str) -> Leagues`.
"""

from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol

from arena.errors import ArenaError

GROUP = "arena.web"


class Leagues(Protocol):
    """The leagues of a store, the one that was run last first."""

    def names(self) -> list[str]:
        """Return the names of all leagues; none if there is no store."""

    def report(self, name: str) -> dict[str, Any]:
        """Return the report of a league, as `arena tournament report --format json` prints it, and its `matches_played`."""

    def journal(self, name: str, identity: str) -> bytes:
        """Return the journal of a match, if all of its pair is over."""


def replay(journal: bytes) -> dict[str, Any]:
    """Return a match, tick by tick."""
    told: dict[str, Any] = _load("replay")(journal)
    return told


def warm() -> None:
    """Load what plays matches again, before anybody waits for it."""
    _load("warm")()


def open_leagues(data: Path, db: str) -> Leagues:
    """Return the leagues of a data folder."""
    leagues: Leagues = _load("leagues")(data, db)
    return leagues


def _load(name: str) -> Any:
    points = entry_points(group=GROUP)
    if name not in points.names:
        raise ArenaError(f"nothing installed here offers {name} to the web page; install the whole of arena-pit")
    return points[name].load()
