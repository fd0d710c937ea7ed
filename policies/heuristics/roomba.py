"""Every unit goes straight on until it bumps, then turns at random, as a cleaning robot does.

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


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return the step towards the flag, straight on, or in a new direction; a bumped unit is where it was a tick ago."""
    side, flag, flies = rules.side, int(memory.enemy_flag[seat]), rules.flies[unit]
    row, column = cell // side, cell % side
    words = draw(sight.seed[seat], unit)
    if flag >= 0 and not flies:
        return pursue(seat, unit, cell, flag, memory, rules, words)
    action = int(memory.heading[seat, unit])
    is_bumped = action == STAY or cell == memory.before[seat, unit]
    if is_bumped or not is_open(memory.ground, seat, side, row, column, action, flies):
        action = 1 + below(words[1], 4)
        for _ in range(4):
            if is_open(memory.ground, seat, side, row, column, action, flies):
                break
            action = right_of(action)
    memory.heading[seat, unit], memory.before[seat, unit] = action, cell
    return action if is_open(memory.ground, seat, side, row, column, action, flies) else STAY


class Roomba(UnitByUnit):
    """Bounces about the board."""

    kernel = each_unit(__name__)
