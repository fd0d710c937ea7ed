"""Wandering on one half of the board: from one random cell to the next."""

from arena.game.compiled import can_enter
from arena.game.philox import below
from arena.jit import jit
from policies.belief.memory import SeatMemory
from policies.belief.team_rules import TeamRules
from policies.chance import Words, one_in

_PATIENCE = 64
"""A goal is given up in one tick of so many: it may lie behind walls."""


@jit(inline=True)
def wander(seat: int, unit: int, cell: int, half: int, memory: SeatMemory, rules: TeamRules, words: Words) -> int:
    """Return where a unit is going: the goal that it has, or a new one if that is reached, hopeless or not yet drawn.

    Parameters
    ----------
    half
        1 for the eastern half, -1 for the western.
    words
        Four, as of `chance.draw`; all but the first are used.
    """
    side, near, goal = rules.side, rules.step[unit] // 2, int(memory.goal[seat, unit])
    is_near = abs(goal // side - cell // side) <= near and abs(goal % side - cell % side) <= near
    if goal >= 0 and not is_near and can_enter(memory.ground[seat, goal], 0) and not one_in(words[1], _PATIENCE):
        return goal
    column = int(below(words[2], side // 2)) + (side // 2 if half > 0 else 0)
    new = int(below(words[3], side)) * side + column
    if new != goal:
        memory.goal[seat, unit], memory.detour[seat, unit] = new, 0
    return new
