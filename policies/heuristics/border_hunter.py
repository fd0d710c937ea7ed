"""One unit guards the own flag and the others hold the lanes of the own half; against a raid, at least two hunt.

When ahead, two attack while nobody raids. From half time on, unless ahead, all but the keeper attack, and the keeper too while
nobody raids.
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

_CALM = 12
"""Ticks without an intruder after which nobody need stay."""


@jit()
def order_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, rules, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    is_ahead, is_half_time = sight.score[seat] > 0, 2 * sight.tick[seat] >= rules.tick_limit
    is_attack = is_half_time and not is_ahead
    if not (is_attack and is_calm):
        assign_roles(1, GUARD, UNREACHED, seat, sight, plan)
    if is_calm and not is_attack and not is_ahead:
        hold_lanes(seat, sight, belief, rules, plan)
    if not is_attack:
        assign_roles(max(2, n_walkers - 2), HUNT, UNREACHED, seat, sight, plan)
        n_rush = 2 if is_ahead and is_calm else 0
        assign_roles(n_walkers - 1 - n_rush, GUARD, UNREACHED, seat, sight, plan)
    order_walkers(seat, sight, belief, rules, plan, WARY, BOLD, 1.0, orders)
    order_flyers(seat, sight, belief, rules, plan, orders)


class BorderHunter(BelievingPolicy):
    """Hunts at home."""

    kernel = each_seat(__name__)
