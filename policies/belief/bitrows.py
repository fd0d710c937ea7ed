"""Sets of cells as rows of bits, and searches that move a whole row at a time.

A set is `side` words of 64 bits: bit c of word r stands for the cell in row r, column c. A board has 64 columns at most, so a row
is always one word, and a step of a breadth-first search is a handful of operations on each row instead of a queue of cells.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.bits import lowest_bit, popcount
from arena.jit import jit

UNREACHED = 32767
"""The distance of a cell to which no way leads."""
NONE = np.uint64(0)
ONE = np.uint64(1)
FULL = np.uint64(0xFFFFFFFFFFFFFFFF)


@jit(inline=True)
def bit(column: int) -> np.uint64:
    """Return the word with one column set."""
    return ONE << np.uint64(column)


@jit(inline=True)
def low_bits(n: int) -> np.uint64:
    """Return the word with the first n columns set, n from 0 to 64."""
    return NONE if n <= 0 else FULL >> np.uint64(64 - min(n, 64))


@jit(inline=True)
def has(rows: NDArray[np.uint64], side: int, cell: int) -> bool:
    """Whether a cell is in the set `rows`; uint64, shape (side,)."""
    return bool((rows[cell // side] >> np.uint64(cell % side)) & ONE != NONE)


@jit(inline=True)
def count(rows: NDArray[np.uint64], side: int) -> int:
    """Return how many cells are in a set."""
    n = 0
    for row in range(side):
        n += popcount(rows[row])
    return n


@jit(inline=True)
def spread(rows: NDArray[np.uint64], allowed: NDArray[np.uint64], side: int) -> None:
    """Add to a set the allowed cells that are one step away; in place."""
    above = NONE
    for row in range(side):
        here = rows[row]
        below = rows[row + 1] if row + 1 < side else NONE
        rows[row] = here | (((here << ONE) | (here >> ONE) | above | below) & allowed[row])
        above = here


@jit()
def flood(
    sources: NDArray[np.uint64],
    allowed: NDArray[np.uint64],
    slow: NDArray[np.uint64],
    delay: int,
    side: int,
    work: NDArray[np.uint64],
    steps: NDArray[np.int16],
) -> None:
    """Write how long a unit that walks takes from each cell to the nearest of some cells.

    Parameters
    ----------
    sources
        uint64, shape (side,): the goals, walkable or not.
    allowed
        uint64, shape (side,): cells that may be walked on.
    slow
        uint64, shape (side,): cells that take `delay` ticks more to step off towards the goal.
    delay
        From 0 to 14.
    work
        uint64, shape (17, 64): scratch. Row 0 holds the cells reached; the rest is a ring of fronts, one for each tick to come.
    steps
        int16, shape (cells,): written; UNREACHED where no way leads.
    """
    for cell in range(side * side):
        steps[cell] = UNREACHED
    reached, ring = work[0], delay + 2
    for row in range(side):
        reached[row] = sources[row]
        work[1, row] = sources[row]
        for later in range(1, ring):
            work[1 + later, row] = NONE
    distance, idle = 0, 0
    while idle < ring:
        front, soon, late = work[1 + distance % ring], work[1 + (distance + 1) % ring], work[1 + (distance + 1 + delay) % ring]
        is_empty = True
        above = NONE
        for row in range(side):
            here = front[row]
            below = front[row + 1] if row + 1 < side else NONE
            if here | above | below != NONE:
                is_empty = False
                new = ((here << ONE) | (here >> ONE) | above | below) & allowed[row] & ~reached[row]
                reached[row] |= new
                soon[row] |= new & ~slow[row]
                late[row] |= new & slow[row]
                first = row * side
                rest = here
                while rest != NONE:
                    steps[first + lowest_bit(rest)] = distance
                    rest &= rest - ONE
            above = here
        for row in range(side):
            front[row] = NONE
        idle = idle + 1 if is_empty else 0
        distance += 1
