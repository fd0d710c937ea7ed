"""Units on foot gather around their own flag, chase enemies on foot that enter their half, and never leave it.

Until the own flag is found they look for it by wandering over their half, as units that fly do throughout.
"""

from arena.game.compiled import column_after, row_after
from arena.jit import jit
from policies.belief.memory import SeatMemory, Sight, nearest_walker
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.heuristics.unit_by_unit import UnitByUnit, each_unit
from policies.tactics.moves import STAY
from policies.tactics.pursuit import pursue
from policies.tactics.wandering import wander


@jit(inline=True)
def _post(unit: int, flag: int, side: int) -> int:
    """Return a cell beside the flag; each of eight units has its own."""
    place = unit % 8 + (unit % 8 > 3)  # the ninth, the middle, is the flag itself
    row, column = flag // side + place // 3 - 1, flag % side + place % 3 - 1
    return min(max(row, 0), side - 1) * side + min(max(column, 0), side - 1)


@jit(inline=True)
def _intruder(seat: int, sight: Sight, memory: SeatMemory, rules: TeamRules, cell: int) -> int:
    """Return the cell of the nearest enemy on foot, or -1 where none is in sight or it is not on the own half."""
    enemy = nearest_walker(seat, sight, rules.side, cell // rules.side, cell % rules.side)
    if enemy >= 0 and memory.ground[seat, enemy] in (rules.own_half, rules.own_flag):
        return enemy
    return -1


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return the step towards an intruder, the own post, or where the unit wanders; none leads onto the enemy's half."""
    side, flag, flies = rules.side, int(memory.own_flag[seat]), rules.flies[unit]
    words = draw(sight.seed[seat], unit)
    goal = -1 if flies else _intruder(seat, sight, memory, rules, cell)
    if goal < 0 and flag >= 0 and not flies:
        goal = _post(unit, flag, side)
    if goal < 0:
        goal = wander(seat, unit, cell, -memory.forward[seat], memory, rules, words)
    action = pursue(seat, unit, cell, goal, memory, rules, words)
    to = memory.ground[seat, row_after(cell // side, action) * side + column_after(cell % side, action)]
    return action if flies or to not in (rules.enemy_half, rules.enemy_flag) else STAY


class Defend(UnitByUnit):
    """Stays at home."""

    kernel = each_unit(__name__)
