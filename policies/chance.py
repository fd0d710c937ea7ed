"""Chance, from a seat's own seed of the tick: the same at every batch size and place in the batch."""

import numpy as np

from arena.game.philox import philox
from arena.jit import jit

Words = tuple[np.uint64, np.uint64, np.uint64, np.uint64]
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)


@jit(inline=True)
def draw(seed: np.uint64, unit: int) -> Words:
    """Return four words for one unit, each a uint64 below 2**32."""
    return philox((seed & _LOW, seed >> _HALF), unit, 0, 0, 0)


@jit(inline=True)
def one_in(word: np.uint64, n: int) -> bool:
    """Whether an event of probability 1 / n happens."""
    return bool(word * np.uint64(n) <= _LOW)
