"""Flyers search for the flag where it is likeliest; the nearest unit on foot runs for it around danger, and two follow.

One guards the own flag until no intruder was seen for eight ticks, then joins the run. Guards of the enemy's flag are lured away
first.
"""

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.heuristics.believing import BelievingPolicy, each_seat
from policies.tactics.luring import lure
from policies.tactics.roles import BOLD, GUARD, WARY, Plan, assign_roles, order_walkers, survey
from policies.tactics.scouting import order_flyers

_CALM = 8
"""Ticks without an intruder after which nobody stays to guard."""


@jit()
def order_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, rules, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    if not is_calm and sight.score[seat] >= 0:
        assign_roles(min(1, n_walkers - 1), GUARD, UNREACHED, seat, sight, plan)
    if is_calm:
        lure(seat, sight, belief, rules, plan, orders)
    order_walkers(seat, sight, belief, rules, plan, WARY, BOLD, 1.0, orders)
    order_flyers(seat, sight, belief, rules, plan, orders)


class ScoutRush(BelievingPolicy):
    """Runs first."""

    kernel = each_seat(__name__)
