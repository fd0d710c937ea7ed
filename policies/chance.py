"""Chance, from a seat's own seed of the tick: the same at every batch size and place in the batch."""

import numpy as np

from arena.game.philox import below, philox
from arena.jit import jit

Words = tuple[np.uint64, np.uint64, np.uint64, np.uint64]
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
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


@jit(inline=True)
def mix(number: np.uint64) -> np.uint64:
    """Return a word of 64 bits that follows from a number: SplitMix64, which takes a nanosecond where playouts need millions.

    Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators" (OOPSLA 2014).
    """
    z = number * _GOLDEN
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@jit(inline=True)
def choose(word: np.uint64, n: int) -> int:
    """Return an integer in 0 .. n - 1 made of a word of `mix`."""
    return int(below(word >> _HALF, n))
