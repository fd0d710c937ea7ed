"""What a stranger's process may use."""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

from arena.errors import InputError, UnknownNameError


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one process may use, with all that it starts; None is without limit."""

    memory_mb: int | None = None
    """Where control groups can be made, of all its processes together; else the address space of each."""
    cpu_s: int | None = None
    """Processor time of each of its processes."""
    cores: int | None = None
    """Processors' worth of time; held only where control groups can be made."""
    processes: int | None = None
    """Threads included."""
    files: int | None = None
    """Open at once, in each process."""
    disk_mb: int | None = None
    """Of its home, and as much again of its temporary folder and of its shared memory; behind a wall alone."""
    output_kb: int | None = None
    """Of what it prints."""

    def with_(self, assignments: Iterable[str]) -> "Limits":
        """Return these limits with changes such as "memory_mb=500"; `InputError` if one is no limit."""
        limits = self
        for assignment in assignments:
            name, _, number = assignment.partition("=")
            known = [field.name for field in fields(self)]
            if name not in known:
                raise UnknownNameError("limit", name, known)
            if not number.isdecimal() or not 1 <= int(number) <= MOST:
                raise InputError(f"the limit {assignment!r} must be a name and a whole number above 0, as in memory_mb=500")
            limits = replace(limits, **{name: int(number)})
        return limits

    def assignments(self) -> list[str]:
        """Return what `with_` takes."""
        return [f"{field.name}={value}" for field in fields(self) if (value := getattr(self, field.name)) is not None]


MOST = 10**9
NO_LIMITS = Limits()
BEHIND_A_WALL = Limits(memory_mb=2_000, cpu_s=3_600, cores=1, processes=64, files=256, disk_mb=64, output_kb=256)
"""Of whoever plays behind a wall, unless told otherwise."""
