"""Units on foot go for the nearest enemy on foot in sight, or for the flag where that is nearer.

With neither in sight they wander over the enemy's half, as units that fly do throughout.
"""

from arena.jit import jit
from policies.belief.memory import SeatMemory, Sight, nearest_walker
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.heuristics.unit_by_unit import UnitByUnit, each_unit
from policies.tactics.pursuit import pursue
from policies.tactics.wandering import wander


@jit(inline=True)
def _target(seat: int, sight: Sight, memory: SeatMemory, side: int, cell: int) -> int:
    """Return the cell of the nearer one of flag and enemy, or -1 where neither is known."""
    row, column = cell // side, cell % side
    enemy, flag = nearest_walker(seat, sight, side, row, column), int(memory.enemy_flag[seat])
    if enemy < 0 or flag < 0:
        return max(enemy, flag)
    to_enemy = abs(enemy // side - row) + abs(enemy % side - column)
    to_flag = abs(flag // side - row) + abs(flag % side - column)
    return flag if to_flag <= to_enemy else enemy


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return the step towards the target, or where the unit wanders."""
    words = draw(sight.seed[seat], unit)
    goal = -1 if rules.flies[unit] else _target(seat, sight, memory, rules.side, cell)
    if goal < 0:
        goal = wander(seat, unit, cell, memory.forward[seat], memory, rules, words)
    return pursue(seat, unit, cell, goal, memory, rules, words)


class Fighter(UnitByUnit):
    """Looks for a fight."""

    kernel = each_unit(__name__)
