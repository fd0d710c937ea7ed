"""The odds of combat: what going to a cell would cost, and what it would win, as far as the own side sees.

The rules are those of `arena.game.rules`; `docs/reference/rules.md` says them in words. F is what stands for a unit in its
fight, E what stands against it.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import (
    home_bonus,
    is_in_reach,
    odds,
    own_strength,
    squared_distance,
    survives_without_chance,
)
from arena.jit import jit
from policies.belief.belief import Belief
from policies.belief.bitrows import NONE, has, low_bits
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules

_AFTER_A_STEP = 0.5
"""How likely an enemy that must step up for a fight is taken to do so."""


@jit(inline=True)
def squared(one: int, other: int, side: int) -> int:
    """Return the squared Euclidean distance between two cells."""
    down, right = one // side - other // side, one % side - other % side
    return int(squared_distance(down, right))


@jit(inline=True)
def can_hit(enemy_cell: int, kind: int, cell: int, rules: TeamRules) -> float:
    """Return how likely an enemy has `cell` in range after the next move: 1, `_AFTER_A_STEP` or 0."""
    reach, side = rules.type_reach[kind], rules.side
    down, right = abs(enemy_cell // side - cell // side), abs(enemy_cell % side - cell % side)
    if is_in_reach(squared_distance(down, right), reach):
        return 1.0
    longer, shorter = max(down, right), min(down, right)
    if rules.enemy_step > 0 and is_in_reach(squared_distance(longer - 1, shorter), reach):
        return _AFTER_A_STEP
    return 0.0


@jit(inline=True)
def weigh(
    seat: int,
    unit: int,
    cell: int,
    sight: Sight,
    belief: Belief,
    rules: TeamRules,
    aims: NDArray[np.int64],
    force: NDArray[np.float64],
) -> tuple[float, float, float]:
    """Return what going to a cell does to a unit, to the enemies in sight, and to its friends.

    Parameters
    ----------
    aims
        int64, shape (own units,): where each own unit will stand, as far as decided.
    force
        float64, shape (own units, 2): F and E of each own unit; E is 0 where no enemy has it in range. The unit's row is written.

    Returns
    -------
    tuple
        The chance that the unit falls; by how much it raises the expected count of fallen enemies; and by how much it lowers
        that of fallen friends, by its support. Each as of one tick.
    """
    side = rules.side
    enemies, kills = 0.0, 0.0
    for place in range(sight.enemy_cell.shape[1]):
        at = int(sight.enemy_cell[seat, place])
        if at < 0:
            break
        kind = sight.enemy_type[seat, place]
        likely = 0.0 if sight.enemy_flies[seat, place] else can_hit(at, kind, cell, rules)
        if likely > 0.0:
            enemies += likely * rules.type_strength[kind]
            kills += likely * _kills_added(seat, unit, place, sight, belief, rules, aims)
    is_home = not has(belief.enemy_half[seat], side, cell)
    friends, averted = float(own_strength(rules.strength[unit], rules.self_counts) + home_bonus(is_home)), 0.0
    for other in range(aims.shape[0]):
        if other == unit or rules.flies[other] or not sight.alive[seat, other]:
            continue
        apart = squared(aims[other], cell, side)
        if is_in_reach(apart, rules.reach[other]):
            friends += rules.strength[other]
        if force[other, 1] > 0.0 and is_in_reach(apart, rules.reach[unit]):
            averted += odds(force[other, 1], force[other, 0]) - odds(force[other, 1], force[other, 0] + rules.strength[unit])
    force[unit, 0], force[unit, 1] = friends, 0.0
    if enemies == 0.0:
        return 0.0, 0.0, averted
    if not rules.is_combat_random:
        return (0.0 if survives_without_chance(is_home) else 1.0), kills, 0.0
    force[unit, 1] = enemies + home_bonus(not is_home)
    return odds(force[unit, 1], friends), kills, averted


@jit(inline=True)
def _kills_added(
    seat: int, unit: int, place: int, sight: Sight, belief: Belief, rules: TeamRules, aims: NDArray[np.int64]
) -> float:
    """Return by how much one more of ours in its range lowers an enemy's chance to survive."""
    side, at = rules.side, int(sight.enemy_cell[seat, place])
    kind = sight.enemy_type[seat, place]
    is_its_home = has(belief.enemy_half[seat], side, at)
    ours = 0.0
    for other in range(aims.shape[0]):
        is_fit = other != unit and not rules.flies[other] and sight.alive[seat, other]
        if is_fit and is_in_reach(squared(aims[other], at, side), rules.reach[other]):
            ours += rules.strength[other]
    theirs = float(home_bonus(is_its_home) + own_strength(rules.type_strength[kind], rules.self_counts))
    for other in range(sight.enemy_cell.shape[1]):
        where = int(sight.enemy_cell[seat, other])
        if where < 0:
            break
        if other != place and is_in_reach(squared(at, where, side), rules.type_reach[sight.enemy_type[seat, other]]):
            theirs += rules.type_strength[sight.enemy_type[seat, other]]
    without = ours + home_bonus(not is_its_home)
    return float(odds(without + rules.strength[unit], theirs) - (odds(without, theirs) if ours > 0.0 else 0.0))


@jit()
def mark_danger(seat: int, sight: Sight, rules: TeamRules, rows: NDArray[np.uint64]) -> None:
    """Set `rows`, uint64 of shape (side,), to the cells that an enemy in sight can hit after its next step."""
    side = rules.side
    for row in range(side):
        rows[row] = NONE
    for place in range(sight.enemy_cell.shape[1]):
        at = int(sight.enemy_cell[seat, place])
        if at < 0:
            break
        reach = rules.type_reach[sight.enemy_type[seat, place]]
        if sight.enemy_flies[seat, place] or reach < 0:
            continue
        for row in range(side):
            down = abs(row - at // side)
            width = _half_width(reach, down)
            if rules.enemy_step > 0:
                width = max(width + 1 if width >= 0 else -1, _half_width(reach, abs(down - 1)), _half_width(reach, down + 1))
            if width >= 0:
                rows[row] |= low_bits(min(at % side + width + 1, side)) & ~low_bits(max(at % side - width, 0))


@jit(inline=True)
def _half_width(reach: int, down: int) -> int:
    """Return how many columns to either side a disc goes, so many rows from its middle; -1 outside."""
    width = -1
    while is_in_reach(squared_distance(width + 1, down), reach):
        width += 1
    return width
