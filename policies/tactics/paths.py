"""Shortest ways over remembered ground; what was never seen counts as open."""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter, column_after, row_after
from arena.jit import jit
from policies.belief import bitrows
from policies.belief.bitrows import NONE, bit
from policies.tactics.moves import EAST, NORTH, SOUTH, STAY, WEST, is_open


@jit()
def flood(ground: NDArray[np.int8], seat: int, side: int, goal: int, steps: NDArray[np.int16], work: NDArray[np.uint64]) -> None:
    """Write how many steps a unit on foot is from a goal, on every cell.

    Parameters
    ----------
    ground
        int8, shape (seats, cells).
    steps
        int16, shape (seats, cells): row `seat` is written, UNREACHED where no way leads.
    work
        uint64, shape (19, 64): scratch.
    """
    goals, ground_rows = work[17], work[18]
    for row in range(side):
        goals[row] = bit(goal % side) if goal // side == row else NONE
        ground_rows[row] = NONE
        for column in range(side):
            ground_rows[row] |= np.uint64(can_enter(ground[seat, row * side + column], 0)) << np.uint64(column)
    bitrows.flood(goals, ground_rows, goals, 0, side, work, steps[seat])


@jit()
def downhill(ground: NDArray[np.int8], seat: int, side: int, cell: int, steps: NDArray[np.int16]) -> int:
    """Return the step that leads to the goal of `flood` soonest, or STAY at it and where no way leads."""
    best, least, row, column = STAY, steps[seat, cell], cell // side, cell % side
    for action in (NORTH, EAST, SOUTH, WEST):
        if is_open(ground, seat, side, row, column, action, 0):
            there = steps[seat, row_after(row, action) * side + column_after(column, action)]
            if there < least:
                best, least = action, there
    return best
