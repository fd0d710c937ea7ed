"""All units sweep the enemy's half, one lane to each, until its flag is seen; then those on foot run for it.

They run the shortest way over what was seen, taking for open what was not; the others go on sweeping.
"""

from arena.game.compiled import can_enter
from arena.jit import jit
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import SeatMemory, Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw, one_in
from policies.heuristics.unit_by_unit import UnitByUnit, each_unit
from policies.tactics.paths import downhill, flood
from policies.tactics.pursuit import pursue

_PATIENCE = 64
"""A lane's end is given up in one tick of so many: it may lie behind walls."""


@jit(inline=True)
def _lane_end(leg: int, unit: int, n_units: int, side: int, forward: int) -> int:
    """Return where a leg ends: in and out of the enemy's half by turns, each pair half a lane further down."""
    row = ((2 * unit + 1 + leg // 2) * side // (2 * n_units)) % side
    is_far = leg % 4 in (1, 2)
    if forward > 0:
        return row * side + (side - 1 if is_far else side // 2)
    return row * side + (0 if is_far else side // 2 - 1)


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return the step towards the flag, or the end of the unit's leg."""
    side, flag, forward, flies = rules.side, int(memory.enemy_flag[seat]), int(memory.forward[seat]), rules.flies[unit]
    if flag >= 0 and not flies:
        if memory.is_map_new[seat]:
            flood(memory.ground, seat, side, flag, memory.to_flag, memory.work)
            memory.is_map_new[seat] = 0
        if memory.to_flag[seat, cell] < UNREACHED:
            return downhill(memory.ground, seat, side, cell, memory.to_flag)
    row, column, n_units, near = cell // side, cell % side, len(rules.flies), rules.step[unit] // 2
    words = draw(sight.seed[seat], unit)
    goal = _lane_end(int(memory.leg[seat, unit]), unit, n_units, side, forward)
    is_there = abs(goal // side - row) <= near and abs(goal % side - column) <= near
    if is_there or not can_enter(memory.ground[seat, goal], flies) or one_in(words[1], _PATIENCE):
        memory.leg[seat, unit], memory.detour[seat, unit] = (memory.leg[seat, unit] + 1) % (8 * n_units), 0
        goal = _lane_end(int(memory.leg[seat, unit]), unit, n_units, side, forward)
    return pursue(seat, unit, cell, goal, memory, rules, words)


class Rush(UnitByUnit):
    """Finds the flag and runs for it."""

    kernel = each_unit(__name__)
