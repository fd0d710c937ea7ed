"""The venues by their names: each is the function `play` of the module of that name, imported when it is needed."""

from importlib import import_module

from arena.extras import needs
from tournaments.venues.setting import Venue


def find_venue(name: str) -> Venue:
    """Return one of `tournaments.league.league.VENUES`; `InputError` if what it needs is not installed."""
    with needs("cluster", f"the venue {name}"):
        play: Venue = import_module(f"tournaments.venues.{name}").play
    return play
