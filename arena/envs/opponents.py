"""Opponents by name. The arena knows no fighter; who does is named by the entry point `load` of the group `arena.fighters`."""

from functools import cache
from importlib.metadata import entry_points
from typing import Any

from arena.errors import InputError
from arena.policy import BatchFactory

GROUP = "arena.fighters"


@cache
def _loader() -> Any:
    for entry in entry_points(group=GROUP, name="load"):
        return entry.load()
    raise InputError(f"no fighters are installed: nothing names the entry point load of {GROUP}; install the whole of arena-pit")


def load_opponent(opponent: str | BatchFactory) -> BatchFactory:
    """Return a fighter by name or file, as `arena play` takes them, or the factory that was given."""
    factory: BatchFactory = _loader()(opponent) if isinstance(opponent, str) else opponent
    return factory
