"""The ladders by their names: our own, and those of other people's packages, entry points of the group `arena.ladders`."""

from importlib.metadata import entry_points

from arena.errors import UnknownNameError
from arena.pit.ladder import OpenLadder
from tournaments.ladder.ladder import open_ladder

GROUP = "arena.ladders"
"""An entry point of it is an `arena.pit.ladder.OpenLadder`."""
DEFAULT = "openskill"


def find_ladder(name: str = DEFAULT) -> OpenLadder:
    """Return what opens a ladder; `UnknownNameError` if there is none of that name."""
    others = {point.name: point for point in entry_points(group=GROUP)}
    if name in others:
        opener: OpenLadder = others[name].load()
        return opener
    if name != DEFAULT:
        raise UnknownNameError("ladder", name, {DEFAULT, *others})
    return open_ladder
