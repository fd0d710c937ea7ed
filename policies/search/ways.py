"""How far every cell is from every other on foot, over the ground as a seat believes it; what was never seen counts as open."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.state import Tables
from arena.game.types import Action
from arena.jit import jit
from policies.belief.belief import Belief
from policies.belief.bitrows import has

NO_WAY = 255
"""The distance of a cell to which no way leads. A way of more steps than one less counts as that."""
_N_ACTIONS = len(Action)


class Ways(NamedTuple):
    """Ways on foot, for one seat."""

    far: NDArray[np.uint8]
    """Shape (cells, cells): steps to the first cell from the second; 0 for a cell itself, unless it is an obstacle."""
    open: NDArray[np.int16]
    """Shape (cells,): the cell itself if it may be walked on, else one near it that may."""
    queue: NDArray[np.int16]
    """Shape (cells,): scratch."""


def make_ways(n_cells: int) -> Ways:
    """Return memory for ways."""
    return Ways(np.zeros((n_cells, n_cells), np.uint8), np.zeros(n_cells, np.int16), np.zeros(n_cells, np.int16))


@jit()
def find_ways(belief: Belief, side: int, tables: Tables, ways: Ways) -> None:
    """Search the ways between all cells that the first seat of a belief does not know as obstacles."""
    walkable = belief.walkable[0]
    for goal in range(side * side):
        far = ways.far[goal]
        for cell in range(side * side):
            far[cell] = NO_WAY
        if not has(walkable, side, goal):
            continue
        far[goal], ways.queue[0] = 0, goal
        head, tail = 0, 1
        while head < tail:
            cell = int(ways.queue[head])
            head += 1
            steps = min(far[cell] + 1, NO_WAY - 1)
            for action in range(1, _N_ACTIONS):
                to = int(tables.neighbour[action, cell])
                if far[to] == NO_WAY and has(walkable, side, to):
                    far[to], ways.queue[tail] = steps, to
                    tail += 1
    for cell in range(side * side):
        ways.open[cell] = _nearest_open(cell, walkable, side)


@jit()
def _nearest_open(cell: int, walkable: NDArray[np.uint64], side: int) -> int:
    """Return the nearest cell that may be walked on, in rings of squares around a cell."""
    for away in range(side):
        for row in range(max(cell // side - away, 0), min(cell // side + away + 1, side)):
            for column in range(max(cell % side - away, 0), min(cell % side + away + 1, side)):
                is_in_ring = max(abs(row - cell // side), abs(column - cell % side)) == away
                if is_in_ring and has(walkable, side, row * side + column):
                    return row * side + column
    return cell
