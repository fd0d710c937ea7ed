"""From what is believed to orders: who attacks, who guards and who hunts, and which step each takes.

A script decides how many units take which role and how dear a life is; this module does the rest, one seat at a time: `survey`,
then `assign_roles` as often as needed, then `order_walkers`. `Plan` keeps what is remembered from tick to tick, by seat.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import column_after, is_in_reach, is_on_board, row_after
from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import NONE, UNREACHED, bit, flood, has
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.tactics.moves import STAY
from policies.tactics.odds import mark_danger, squared, weigh

N_ROLES = 7
ATTACK, GUARD, HUNT, DECOY, WAIT, NORTH, SOUTH = range(N_ROLES)
"""Roles, and rows of `Plan.way`: to the enemy's flag round danger, to the own flag, to the nearest intruder; two of `luring`, and
two of `lanes`.
"""
BOLD, WARY = 8.0, 60.0
"""What a life is worth, in steps of way. Four attackers score 0.54 against `defend` with 8, 0.72 with 30, 0.74 with 60."""
NEVER = -1000
"""A tick so long ago that nothing is remembered of it."""
_GUARDS, _POST = 2, 3
"""How many enemies within how many steps of their flag are guards."""
_DETOUR = 3
"""Ticks that a cell in danger counts more. Measured against `defend`: 3 is better than 0, 1, 5 and 12."""
_BLOCKED, _PRIZE, _LOST = 6.0, 1000.0, 200.0
"""What it costs to want a friend's cell, what it is worth to step on the flag, and how far a goal is to which no way leads."""
_TARRIES, _THERE = 1.5, 3
"""What it costs to stop on the way to a lane, more than to go round a friend that stands in it; and how near is there."""
_PAIR, _APART, _STRAYED = 2, 4, 2.0
"""How near mates keep, from how far on they have lost each other, and what each cell between is worth; in cells and steps."""


class Plan(NamedTuple):
    """Scratch for the orders of one seat, and what a script remembers of each."""

    aim: NDArray[np.int64]
    """Shape (own units,): the cell where each unit will stand, as far as decided."""
    is_decided: NDArray[np.uint8]
    """Shape (own units,)."""
    role: NDArray[np.int8]
    """Shape (own units,): one of ATTACK to SOUTH; -1 for one that flies or is dead."""
    mate: NDArray[np.int8]
    """Shape (own units,): a friend to stay near, or -1."""
    force: NDArray[np.float64]
    """Shape (own units, 2): of `odds.weigh`."""
    way: NDArray[np.int16]
    """Shape (7 roles, cells): steps to where each role goes."""
    goal: NDArray[np.uint64]
    """Shape (64,): a cell to which ways are searched."""
    decoy: NDArray[np.int64]
    """Shape (1,): the cell where the decoy will stand, or -1."""
    danger: NDArray[np.uint64]
    """Shape (64,): cells that an enemy in sight can hit."""
    intruders: NDArray[np.uint64]
    """Shape (64,): enemies on foot in sight on the own half."""
    unseen: NDArray[np.uint64]
    """Shape (64,): what is left for the units that fly to look at."""
    raided_at: NDArray[np.int32]
    """Shape (seats,): the last tick with an intruder in sight, 0 before the first."""
    guarded_at: NDArray[np.int32]
    """Shape (seats,): the last tick with guards in sight at the enemy's flag."""
    choice: NDArray[np.int8]
    """Shape (seats,): of `chameleon`; -1 before it has chosen."""


def make_plan(n_seats: int, n_units: int, n_cells: int) -> Plan:
    """Return memory for plans."""
    return Plan(
        aim=np.zeros(n_units, np.int64),
        is_decided=np.zeros(n_units, np.uint8),
        role=np.zeros(n_units, np.int8),
        mate=np.zeros(n_units, np.int8),
        force=np.zeros((n_units, 2)),
        way=np.zeros((N_ROLES, n_cells), np.int16),
        goal=np.zeros(64, np.uint64),
        decoy=np.zeros(1, np.int64),
        danger=np.zeros(64, np.uint64),
        intruders=np.zeros(64, np.uint64),
        unseen=np.zeros(64, np.uint64),
        raided_at=np.zeros(n_seats, np.int32),
        guarded_at=np.full(n_seats, NEVER, np.int32),
        choice=np.full(n_seats, -1, np.int8),
    )


def forget_plan(plan: Plan, seats: NDArray[np.intp]) -> None:
    """Clear what some seats remember from tick to tick."""
    plan.raided_at[seats] = 0
    plan.guarded_at[seats] = NEVER
    plan.choice[seats] = -1


@jit()
def survey(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan) -> int:
    """Find the ways of this tick, let every unit on foot attack, and return how many there are."""
    side, n_walkers, n_guards, is_raided = rules.side, 0, 0, False
    for unit in range(plan.aim.shape[0]):
        plan.aim[unit], plan.is_decided[unit], plan.mate[unit] = sight.cell[seat, unit], 0, -1
        plan.force[unit, 1] = 0.0
        walks = sight.alive[seat, unit] and not rules.flies[unit]
        plan.role[unit] = ATTACK if walks else -1
        n_walkers += walks
    plan.decoy[0] = -1
    mark_danger(seat, sight, rules, plan.danger)
    flood(belief.flag_rows[seat], belief.walkable[seat], plan.danger, _DETOUR, side, belief.work, plan.way[ATTACK])
    for cell in range(side * side):
        plan.way[GUARD, cell], plan.way[HUNT, cell] = belief.to_home[seat, cell], UNREACHED
    for row in range(side):
        plan.intruders[row] = NONE
    for place in range(sight.enemy_cell.shape[1]):
        at = int(sight.enemy_cell[seat, place])
        if at < 0:
            break
        if sight.enemy_flies[seat, place]:
            continue
        n_guards += belief.enemy_flag[seat] >= 0 and belief.to_flag[seat, at] <= _POST
        if not has(belief.enemy_half[seat], side, at):
            plan.intruders[at // side] |= bit(at % side)
            is_raided = True
    if sight.tick[seat] == 0:
        plan.raided_at[seat], plan.guarded_at[seat] = 0, NEVER
    if n_guards >= _GUARDS:
        plan.guarded_at[seat] = sight.tick[seat]
    if is_raided:
        plan.raided_at[seat] = sight.tick[seat]
        flood(plan.intruders, belief.walkable[seat], plan.danger, 0, side, belief.work, plan.way[HUNT])
    return n_walkers


@jit()
def assign_roles(n: int, role: int, nearer_than: int, seat: int, sight: Sight, plan: Plan) -> int:
    """Give a role to those up to `n` attackers that have the shortest way to it; return how many took it."""
    taken = 0
    for _ in range(n):
        taken += assign_role(ATTACK, role, nearer_than, seat, sight, plan) >= 0
    return taken


@jit(inline=True)
def assign_role(old: int, role: int, nearer_than: int, seat: int, sight: Sight, plan: Plan) -> int:
    """Give a role to the unit of an old one that has the shortest way to it; return which, or -1."""
    chosen, least = -1, nearer_than
    for unit in range(plan.role.shape[0]):
        far = plan.way[role, sight.cell[seat, unit]]
        if plan.role[unit] == old and far < least:
            chosen, least = unit, far
    if chosen >= 0:
        plan.role[chosen] = role
    return chosen


@jit()
def order_walkers(
    seat: int,
    sight: Sight,
    belief: Belief,
    rules: TeamRules,
    plan: Plan,
    attackers_life: float,
    guards_life: float,
    bite: float,
    orders: Orders,
) -> None:
    """Write the orders of the units on foot; those nearest to the flag decide first.

    Parameters
    ----------
    attackers_life, guards_life
        What an own life is worth, in steps of way.
    bite
        What an enemy's life is worth beside it; 1 is as much.
    """
    for _ in range(orders.shape[1]):
        chosen, least = -1, 0
        for unit in range(orders.shape[1]):
            far = plan.way[ATTACK, sight.cell[seat, unit]]
            if plan.role[unit] >= 0 and not plan.is_decided[unit] and (chosen < 0 or far < least):
                chosen, least = unit, far
        if chosen < 0:
            return
        life = guards_life if plan.role[chosen] in (GUARD, HUNT) else attackers_life
        orders[seat, chosen] = _step(seat, chosen, sight, belief, rules, plan, life, bite * life)


@jit(inline=True)  # a call hands over every array of four named tuples, and took longer than what it did
def _step(seat: int, unit: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, life: float, prey: float) -> int:
    """Return the step that costs least: way left, risk, and what stands there; note where it leads."""
    side, cell, role = rules.side, int(sight.cell[seat, unit]), plan.role[unit]
    first = int(draw(sight.seed[seat], unit)[0] & np.uint64(3))
    prize = int(belief.enemy_flag[seat]) if role != GUARD else -1
    _support(seat, unit, cell, -1.0, rules, plan)
    best, least, target, friends, enemies = STAY, 0.0, -1, 0.0, 0.0
    for turn in range(5 if rules.step[unit] else 1):
        action = STAY if turn == 0 else 1 + (turn + first) % 4
        to = step_to(cell, action, seat, belief, side)
        if to < 0:
            continue
        fall, kills, averted = weigh(seat, unit, to, sight, belief, rules, plan.aim, plan.force)
        far = float(plan.way[role, to]) if plan.way[role, to] < UNREACHED else _LOST
        if action == STAY and role in (NORTH, SOUTH) and far > _THERE:
            far += _TARRIES
        cost = far + life * (fall - averted) - prey * kills + _crowd(seat, unit, cell, to, sight, rules, plan)
        if to == prize:
            cost -= _PRIZE
        if target < 0 or cost < least:
            best, least, target, friends, enemies = action, cost, to, plan.force[unit, 0], plan.force[unit, 1]
    plan.force[unit, 0], plan.force[unit, 1] = friends, enemies
    _support(seat, unit, target, 1.0, rules, plan)
    plan.aim[unit], plan.is_decided[unit] = target, 1
    return best


@jit(inline=True)
def step_to(cell: int, action: int, seat: int, belief: Belief, side: int) -> int:
    """Return the cell to which a step on foot leads, or -1: off the board, or onto what is known as an obstacle."""
    row, column = row_after(cell // side, action), column_after(cell % side, action)
    if not is_on_board(row, column, side):
        return -1
    to = row * side + column
    return to if action == STAY or has(belief.walkable[seat], side, to) else -1


@jit(inline=True)
def _support(seat: int, unit: int, cell: int, sign: float, rules: TeamRules, plan: Plan) -> None:
    """Add what a unit at a cell gives to the strength of friends in contact, or take it away."""
    for other in range(plan.aim.shape[0]):
        apart = squared(plan.aim[other], cell, rules.side)
        if other != unit and plan.force[other, 1] > 0.0 and is_in_reach(apart, rules.reach[unit]):
            plan.force[other, 0] = max(plan.force[other, 0] + sign * rules.strength[unit], 0.0)


@jit(inline=True)
def _crowd(seat: int, unit: int, cell: int, to: int, sight: Sight, rules: TeamRules, plan: Plan) -> float:
    """Return what it costs to go where a friend goes, to change places with one, to push an enemy, or to leave a mate."""
    cost = 0.0
    for other in range(plan.aim.shape[0]):
        is_in_the_way = plan.aim[other] == to or (plan.aim[other] == cell and sight.cell[seat, other] == to)
        if other != unit and plan.is_decided[other] and is_in_the_way:
            cost += _BLOCKED
    for place in range(sight.enemy_cell.shape[1]):
        if sight.enemy_cell[seat, place] == to and not sight.enemy_flies[seat, place] and to != cell:
            cost += 1.0
    mate = int(plan.mate[unit])
    if mate >= 0:
        there, side = int(plan.aim[mate]), rules.side
        apart = max(abs(there // side - to // side), abs(there % side - to % side))
        cost += _STRAYED * (min(max(apart, _PAIR), _APART) - _PAIR)
    return cost


@jit()
def find_way(cell: int, role: int, seat: int, belief: Belief, plan: Plan, side: int) -> None:
    """Make one cell, or none for -1, that to which the way of a role leads."""
    for row in range(side):
        plan.goal[row] = bit(cell % side) if cell >= 0 and cell // side == row else NONE
    flood(plan.goal, belief.walkable[seat], plan.danger, 0, side, belief.work, plan.way[role])
