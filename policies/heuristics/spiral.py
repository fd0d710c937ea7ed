"""Every unit winds outwards in a square spiral, turns early at obstacles, and begins anew once as wide as the board.

Once the enemy's flag was seen, units on foot go for it.
"""

from arena.game.philox import below
from arena.jit import jit
from policies.belief.memory import SeatMemory, Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.heuristics.unit_by_unit import UnitByUnit, each_unit
from policies.tactics.moves import STAY, is_open, right_of
from policies.tactics.pursuit import pursue

_PITCH = 2
"""Cells between one winding and the next, in ticks of the unit."""


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return the step towards the flag, or along the spiral."""
    side, flag, flies = rules.side, int(memory.enemy_flag[seat]), rules.flies[unit]
    heading, leg, left = memory.heading, memory.leg, memory.left
    row, column = cell // side, cell % side
    if flag >= 0 and not flies:
        return pursue(seat, unit, cell, flag, memory, rules, draw(sight.seed[seat], unit))
    if heading[seat, unit] == STAY or _PITCH * leg[seat, unit] * max(rules.step[unit], 1) > 2 * side:
        heading[seat, unit] = 1 + below(draw(sight.seed[seat], unit)[1], 4)
        leg[seat, unit], left[seat, unit] = 1, _PITCH
    for _ in range(4):
        action = int(heading[seat, unit])
        if left[seat, unit] > 0 and is_open(memory.ground, seat, side, row, column, action, flies):
            left[seat, unit] -= 1
            return action
        heading[seat, unit] = right_of(action)
        leg[seat, unit] += 1
        left[seat, unit] = _PITCH * ((leg[seat, unit] + 1) // 2)
    return STAY


class Spiral(UnitByUnit):
    """Winds outwards."""

    kernel = each_unit(__name__)
