"""Every unit walks up and down the column of its own half that borders on the enemy's."""

from arena.jit import jit
from policies.belief.memory import SeatMemory, Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.heuristics.unit_by_unit import UnitByUnit, each_unit
from policies.tactics.moves import NORTH, SOUTH, STAY, behind, is_open
from policies.tactics.pursuit import pursue


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return the step to the border, or along it: units of even index begin northwards, the others southwards."""
    side, flies = rules.side, rules.flies[unit]
    row, column, border = cell // side, cell % side, side // 2 - (memory.forward[seat] > 0)
    if abs(column - border) > rules.step[unit] // 2:
        return pursue(seat, unit, cell, row * side + border, memory, rules, draw(sight.seed[seat], unit))
    heading = int(memory.heading[seat, unit])
    if heading == STAY:
        heading = SOUTH if unit % 2 else NORTH
    if not is_open(memory.ground, seat, side, row, column, heading, flies):
        heading = behind(heading)
    memory.heading[seat, unit] = heading
    return heading if is_open(memory.ground, seat, side, row, column, heading, flies) else STAY


class Patrol(UnitByUnit):
    """Guards the border."""

    kernel = each_unit(__name__)
