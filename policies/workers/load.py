"""Fighters by their names, strangers' in processes of their own behind walls."""

from collections.abc import Mapping

from arena.policy import BatchFactory
from arena.sandbox.limits import BEHIND_A_WALL
from arena.sandbox.process import Sandbox
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


def load_walled(
    specs: Mapping[str, str], sandboxes: Mapping[str, Sandbox], patience_s: float | None, most_seats: int, name: str
) -> BatchFactory:
    """Return the fighter behind an entry's name; one whose sandbox has a wall, in processes of its own behind it.

    Parameters
    ----------
    patience_s
        What a fighter behind a wall may take for a turn before its process is ended; None waits for ever.
    most_seats
        Matches that it plays at once, and so how many processes of it think side by side.

    Raises
    ------
    InputError
        The fighter cannot be loaded, or no wall can be built on this machine.
    """
    sandbox = sandboxes.get(name)
    if sandbox is None or not sandbox.has_wall:
        return load_entry(specs, name)
    factory = WorkerFactory(specs[name], has_wall=True, limits=sandbox.limits, patience_s=patience_s, most_seats=most_seats)
    factory.prepare()
    return factory
