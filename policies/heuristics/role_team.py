"""Each tick, units become keeper, second guard, interceptor and attackers by who is nearest; attackers avoid danger.

When no intruder was seen for sixteen ticks, all attack with care and lure away the guards of the flag. An enemy that stays home
may attack at half time, so guards are posted then. Once ahead, all go home except a unit that is about to take the flag.
"""

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.heuristics.believing import BelievingPolicy, each_seat
from policies.tactics.luring import lure
from policies.tactics.roles import ATTACK, GUARD, HUNT, NEVER, WARY, Plan, assign_roles, order_walkers, survey
from policies.tactics.scouting import order_flyers

_CALM = 16
"""Ticks without an intruder after which the enemy is taken for one that stays at home."""
_GUARDS, _NEAR = 2, 4
"""How many guard where somebody raids, and how near an intruder must come for one more to meet it, who else guards as well."""
_EARLIEST, _LATEST = 0.48, 0.6
"""Shares of the match between which those are awaited who have stayed at home."""
_KEEN = 4.0
"""What a guard's life is worth; with 8, `scout_rush` and `squad` score 0.02 more."""
_HOLDS, _SNATCH = 2.0, 6
"""How much dearer a life is when ahead; and how near the flag must be to go for it even so."""
_LATE, _HURRY = 30, 1.5
"""In the last ticks, unless ahead, an enemy's life is worth more than an own one: a draw is half a loss."""


@jit()
def order_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, rules, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    is_due = _EARLIEST * rules.tick_limit <= sight.tick[seat] < _LATEST * rules.tick_limit
    if is_due and plan.guarded_at[seat] != NEVER:
        is_calm = False
    life = WARY
    if sight.score[seat] > 0:
        life *= _HOLDS
        _guard_with_all_but_near(seat, sight, plan)
    elif not is_calm:
        n_guards = assign_roles(min(_GUARDS, n_walkers - 1), GUARD, UNREACHED, seat, sight, plan)
        if n_walkers - n_guards > 1 and assign_roles(1, HUNT, _NEAR, seat, sight, plan) == 0:
            assign_roles(1, GUARD, UNREACHED, seat, sight, plan)
    if is_calm:
        lure(seat, sight, belief, rules, plan, orders)
    is_late = rules.tick_limit - sight.tick[seat] < _LATE
    order_walkers(seat, sight, belief, rules, plan, life, _KEEN, _HURRY if is_late and sight.score[seat] <= 0 else 1.0, orders)
    order_flyers(seat, sight, belief, rules, plan, orders)


@jit()
def _guard_with_all_but_near(seat: int, sight: Sight, plan: Plan) -> None:
    """Make every unit a guard that is not about to take the flag."""
    for unit in range(plan.role.shape[0]):
        if plan.role[unit] == ATTACK and plan.way[ATTACK, sight.cell[seat, unit]] > _SNATCH:
            plan.role[unit] = GUARD


class RoleTeam(BelievingPolicy):
    """Plays for time and numbers."""

    kernel = each_seat(__name__)
