"""Steps on remembered ground, as kernels: which way is open, and which way leads to a goal."""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter, column_after, is_on_board, row_after
from arena.game.types import Action
from arena.jit import jit
from policies.chance import one_in

STAY, NORTH, EAST, SOUTH, WEST = (int(action) for action in Action)
_ONE = np.uint64(1)
_PATIENCE = 32
"""A detour is given up in one tick of so many: the goal may have moved."""


@jit(inline=True)
def right_of(action: int) -> int:
    """Return the direction a quarter turn clockwise."""
    return action % 4 + 1


@jit(inline=True)
def left_of(action: int) -> int:
    """Return the direction a quarter turn anticlockwise."""
    return (action + 2) % 4 + 1


@jit(inline=True)
def behind(action: int) -> int:
    """Return the opposite direction."""
    return (action + 1) % 4 + 1


@jit(inline=True)
def is_open(ground: NDArray[np.int8], seat: int, side: int, row: int, column: int, action: int, flies: int) -> bool:
    """Whether a step stays on the board and, for a unit that walks, off what `ground` shows as an obstacle.

    Parameters
    ----------
    ground
        int8, shape (seats, cells): codes of the ground, HIDDEN where unknown.
    action
        A direction; not STAY.
    """
    to_row, to_column = row_after(row, action), column_after(column, action)
    return bool(is_on_board(to_row, to_column, side) and can_enter(ground[seat, to_row * side + to_column], flies))


@jit()
def head_for(
    ground: NDArray[np.int8],
    seat: int,
    side: int,
    row: int,
    column: int,
    goal: int,
    flies: int,
    step: int,
    detour: int,
    word: np.uint64,
) -> tuple[int, int]:
    """Return the next step towards a goal, round whatever is in the way.

    Parameters
    ----------
    goal
        A cell. A unit is there when another step would not bring it nearer.
    detour
        What this function gave for the unit at its last step; 0 before, and for another goal.
    word
        Decides between left and right where nothing else does.

    Returns
    -------
    tuple
        The action, STAY at the goal or where no way is open; and the detour, 0 off obstacles.

    Notes
    -----
    A unit that is blocked keeps a hand on the wall until it is no farther from the goal than where it met the wall, and
    can go on from there: leaving sooner leads back, and would rock it in a pocket for ever. A detour is one number, that
    distance x 8 + which hand x 4 + (direction - 1).
    """
    down, right = goal // side - row, goal % side - column
    vertical = STAY if abs(down) <= step // 2 else (SOUTH if down > 0 else NORTH)
    horizontal = STAY if abs(right) <= step // 2 else (EAST if right > 0 else WEST)
    first, second = (vertical, horizontal) if abs(down) > abs(right) else (horizontal, vertical)
    if first == STAY:
        first, second = second, STAY
    if first == STAY:
        return STAY, 0
    distance = abs(down) + abs(right)
    if detour == 0 or distance <= detour // 8 or one_in(word, _PATIENCE):
        for action in (first, second):
            if action != STAY and is_open(ground, seat, side, row, column, action, flies):
                return action, 0
    if detour == 0:
        is_left_hand = int(word & _ONE)
        detour = distance * 8 + is_left_hand * 4 + (right_of(first) if is_left_hand else left_of(first)) - 1
    met, is_left_hand, heading = detour // 8, detour // 4 % 2, detour % 4 + 1
    wall = left_of(heading) if is_left_hand else right_of(heading)
    if not is_open(ground, seat, side, row, column, wall, flies) and not is_open(ground, seat, side, row, column, heading, True):
        is_left_hand, heading = 1 - is_left_hand, behind(heading)  # the board ends here: the other way round is shorter
    action = left_of(heading) if is_left_hand else right_of(heading)
    for _ in range(4):
        if is_open(ground, seat, side, row, column, action, flies):
            return action, met * 8 + is_left_hand * 4 + action - 1
        action = right_of(action) if is_left_hand else left_of(action)
    return STAY, 0
