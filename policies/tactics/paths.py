"""Shortest ways over remembered ground; what was never seen counts as open."""

from typing import Any

from arena.game.compiled import column_after, row_after
from arena.jit import jit
from policies.tactics.moves import EAST, NORTH, SOUTH, STAY, WEST, is_open

UNREACHED = 32767


@jit()
def flood(ground: Any, seat: int, side: int, goal: int, steps: Any, queue: Any) -> None:
    """Write how many steps a unit that walks is from a goal, on every cell.

    Parameters
    ----------
    ground
        int8, shape (seats, cells).
    steps
        int16, shape (seats, cells): row `seat` is written, UNREACHED where no way leads.
    queue
        int16, shape (cells,): scratch.
    """
    for cell in range(side * side):
        steps[seat, cell] = UNREACHED
    steps[seat, goal] = 0
    queue[0] = goal
    first, last = 0, 1
    while first < last:
        cell = int(queue[first])
        first += 1
        row, column = cell // side, cell % side
        for action in (NORTH, EAST, SOUTH, WEST):
            if is_open(ground, seat, side, row, column, action, 0):
                to = row_after(row, action) * side + column_after(column, action)
                if steps[seat, to] == UNREACHED:
                    steps[seat, to] = steps[seat, cell] + 1
                    queue[last] = to
                    last += 1


@jit()
def downhill(ground: Any, seat: int, side: int, row: int, column: int, steps: Any) -> int:
    """Return the step that leads to the goal of `flood` soonest, or STAY at it and where no way leads."""
    best, least = STAY, steps[seat, row * side + column]
    for action in (NORTH, EAST, SOUTH, WEST):
        if is_open(ground, seat, side, row, column, action, 0):
            there = steps[seat, row_after(row, action) * side + column_after(column, action)]
            if there < least:
                best, least = action, there
    return best
