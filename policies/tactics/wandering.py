"""Wandering on one half of the board: from one random cell to the next."""

from typing import Any

from arena.game.compiled import can_enter
from arena.game.philox import below
from arena.jit import jit
from policies.chance import one_in

_PATIENCE = 64
"""A goal is given up in one tick of so many: it may lie behind walls."""


@jit(inline=True)
def next_goal(ground: Any, seat: int, side: int, cell: int, goal: int, half: int, step: int, words: Any) -> Any:
    """Return the goal itself, or a new one if it is reached, hopeless or not yet drawn.

    Parameters
    ----------
    goal
        A cell, or -1.
    half
        1 for the eastern half, -1 for the western.
    words
        Four, as of `chance.draw`; all but the first are used.
    """
    is_near = abs(goal // side - cell // side) <= step // 2 and abs(goal % side - cell % side) <= step // 2
    if goal >= 0 and not is_near and can_enter(ground[seat, goal], 0) and not one_in(words[1], _PATIENCE):
        return goal
    column = below(words[2], side // 2) + (side // 2 if half > 0 else 0)
    return below(words[3], side) * side + column
