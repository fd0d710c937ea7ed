"""What one seat knows beyond what it is shown at a tick: the ground that it saw before, and which units it has lost."""

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observation, OwnUnit
from arena.game.types import Code

Mask = NDArray[np.bool_]
"""bool, shape (side, side)."""


class GroundMemory:
    """The ground as one seat saw it last, from tick to tick."""

    def __init__(self, side: int) -> None:
        self._ground = np.full((side, side), Code.HIDDEN, np.int8)

    def recall(self, seen: Observation) -> tuple[NDArray[np.int8], Mask]:
        """Return what the seat sees with the ground that it remembers behind it, and where that is memory alone."""
        self._ground = np.where(seen.ground == Code.HIDDEN, self._ground, seen.ground)
        grid = seen.grid
        is_hidden = grid == Code.HIDDEN
        return np.where(is_hidden, self._ground, grid), is_hidden


def find_losses(before: Observation | None, seen: Observation) -> list[OwnUnit]:
    """Return the own units that have fallen since the observation before."""
    if before is None:
        return []
    return [new for old, new in zip(before.units, seen.units, strict=True) if old.alive and not new.alive]
