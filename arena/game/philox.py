"""Philox 4x32-10: randomness as a function of a key and a counter.

Nobody holds a generator: the word of a unit at a tick is the same at every batch size, on every machine,
in whatever order it is asked for.

Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3" (SC 2011).
"""

from enum import IntEnum
from typing import Any

import numpy as np

from arena.jit import jit


class Purpose(IntEnum):
    """What a word is drawn for; the third word of the counter."""

    MOVE = 0
    FIGHT = 1
    BOARD = 2
    SEED = 3


_ROUNDS = 10
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_MULTIPLIER_0 = np.uint64(0xD2511F53)
_MULTIPLIER_1 = np.uint64(0xCD9E8D57)
_WEYL_0 = np.uint64(0x9E3779B9)
_WEYL_1 = np.uint64(0xBB67AE85)


@jit(inline=True)
def philox(key: Any, c0: Any, c1: Any, c2: Any, c3: Any) -> tuple[Any, Any, Any, Any]:
    """Return the four words of one counter.

    Parameters
    ----------
    key
        uint32, shape (2,).
    c0, c1, c2, c3
        The counter, each below 2**32.

    Returns
    -------
    tuple
        Four uint64, each below 2**32.
    """
    x0, x1, x2, x3 = np.uint64(c0), np.uint64(c1), np.uint64(c2), np.uint64(c3)
    k0, k1 = np.uint64(key[0]), np.uint64(key[1])
    for _ in range(_ROUNDS):
        p0 = x0 * _MULTIPLIER_0
        p1 = x2 * _MULTIPLIER_1
        x0 = (p1 >> _HALF) ^ x1 ^ k0
        x2 = (p0 >> _HALF) ^ x3 ^ k1
        x1 = p1 & _LOW
        x3 = p0 & _LOW
        k0 = (k0 + _WEYL_0) & _LOW
        k1 = (k1 + _WEYL_1) & _LOW
    return x0, x1, x2, x3


@jit(inline=True)
def below(word: Any, n: Any) -> Any:
    """Return an integer in 0 .. n - 1 made of a 32-bit `word`, without a division."""
    return np.int64((word * np.uint64(n)) >> _HALF)
