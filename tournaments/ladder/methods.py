"""The ladders by their names: our own, and those of other people's packages, entry points of the group `arena.ladders`."""

from arena.pit.ladder import OpenLadder
from tournaments.ladder.ladder import open_ladder
from tournaments.plug_ins import find_plug_in

GROUP = "arena.ladders"
"""An entry point of it is an `arena.pit.ladder.OpenLadder`."""
DEFAULT = "openskill"
_OWN: dict[str, OpenLadder] = {DEFAULT: open_ladder}


def find_ladder(name: str = DEFAULT) -> OpenLadder:
    """Return what opens a ladder; `InputError` if there is none of that name."""
    return find_plug_in(GROUP, "ladder", _OWN, name)
