"""Fighters by their names, strangers' in processes of their own behind walls."""

from collections.abc import Mapping

from arena.policy import BatchFactory
from arena.sandbox.limits import BEHIND_A_WALL
from policies.registry import is_file_or_program, load_entry
from policies.workers.policy import WorkerFactory

TURN_S = 10.0
"""What a stranger's fighter may take for a turn where no pit's clock runs."""


def load_apart(specs: Mapping[str, str], name: str, *, cheats: bool = False) -> BatchFactory:
    """Return the fighter behind an entry's name as `policies.registry.load_entry` does; files and programs are kept apart.

    Raises
    ------
    InputError
        The fighter cannot be loaded, or no wall can be built on this machine.
    """
    if not is_file_or_program(specs[name]):
        return load_entry(specs, name, cheats=cheats)
    factory = WorkerFactory(specs[name], has_wall=True, limits=BEHIND_A_WALL, patience_s=TURN_S)
    factory.prepare()
    return factory
