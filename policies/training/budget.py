"""How long a run goes on."""

import math
from dataclasses import dataclass

from arena.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """How long a run goes on, until any of these is used up; cloning counts."""

    samples: int | None = None
    """Ticks of one seat."""
    episodes: int | None = None
    """Matches."""
    minutes: float | None = None

    def __post_init__(self) -> None:
        if self.minutes is not None and not 0 < self.minutes < math.inf:
            raise InputError(f"--minutes is {self.minutes}; it must be above 0 and finite")

    def progress(self, *, samples: int = 0, episodes: int = 0, seconds: float = 0.0) -> float:
        """Return how much is used up; 1 is all."""
        parts = [0.0]
        if self.samples is not None:
            parts.append(samples / self.samples)
        if self.episodes is not None:
            parts.append(episodes / self.episodes)
        if self.minutes is not None:
            parts.append(seconds / 60 / self.minutes)
        return max(parts)
