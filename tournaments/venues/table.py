"""The venues by their names: each is the function `play` of the module of that name, imported when it is needed."""

from importlib import import_module

from arena.errors import InputError
from tournaments.venues.setting import Venue


def find_venue(name: str) -> Venue:
    """Return one of `tournaments.league.league.VENUES`; `InputError` if what it needs is not installed."""
    try:
        play: Venue = import_module(f"tournaments.venues.{name}").play
    except ModuleNotFoundError as error:
        if error.name != "ray":
            raise
        raise InputError("the venue ray needs Ray, which is not installed here: pip install 'arena-pit[cluster]'") from error
    return play
