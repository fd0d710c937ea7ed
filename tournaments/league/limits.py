"""What one process of an entry may use."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one process of an entry may use; None is without limit."""

    memory_mb: int | None = None
    """Address space; the libraries that every client loads take about 2,500 of it."""
    cpu_s: int | None = None
    """Processor time."""
    processes: int | None = None
    """Of the user in all, threads included, as the kernel counts them; root is not counted."""


NO_LIMITS = Limits()
