"""One unit guards the own flag and three its approaches; against a raid, three guard the flag and the fourth intercepts.

When ahead by two enemies, all but one attack. From half time on, unless ahead, all attack, or all but two while somebody raids.
"""

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.heuristics.believing import BelievingPolicy, each_seat
from policies.tactics.lanes import hold_lanes
from policies.tactics.roles import BOLD, GUARD, HUNT, WARY, Plan, assign_roles, order_walkers, survey
from policies.tactics.scouting import order_flyers

_CALM, _STRIKE = 12, 20
"""Ticks without an intruder after which nobody need stay; and the score at which it strikes, two enemies ahead."""


@jit()
def order_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, rules, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    is_ahead, is_half_time = sight.score[seat] > 0, 2 * sight.tick[seat] >= rules.tick_limit
    n_guards = n_walkers
    if sight.score[seat] >= _STRIKE:
        n_guards = 1
    elif is_half_time and not is_ahead:
        n_guards = 0 if is_calm else 2
    if n_guards == n_walkers:
        assign_roles(1, HUNT, 2 * rules.side, seat, sight, plan)
        if is_calm and not is_ahead:
            assign_roles(1, GUARD, UNREACHED, seat, sight, plan)
            hold_lanes(seat, sight, belief, rules, plan)
    assign_roles(n_guards, GUARD, UNREACHED, seat, sight, plan)
    order_walkers(seat, sight, belief, rules, plan, WARY, BOLD, 1.0, orders)
    order_flyers(seat, sight, belief, rules, plan, orders)


class Turtle(BelievingPolicy):
    """Waits."""

    kernel = each_seat(__name__)
