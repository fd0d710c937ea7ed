"""Units move in two pairs that keep within two cells of each other where they can; one pair guards, the other attacks.

A pair fights only where it expects to win more than it loses. While nobody raids, both pairs attack and lure away the guards of
the flag; when ahead, both go home.
"""

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.heuristics.believing import BelievingPolicy, each_seat
from policies.tactics.luring import lure
from policies.tactics.odds import squared
from policies.tactics.roles import BOLD, GUARD, HUNT, WARY, Plan, assign_roles, order_walkers, survey
from policies.tactics.scouting import order_flyers

_CALM, _NEAR = 12, 8
"""Ticks without an intruder after which both pairs attack; and how near an intruder must come for both to be at home."""


@jit()
def order_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, rules, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    if sight.score[seat] > 0:
        assign_roles(n_walkers, GUARD, UNREACHED, seat, sight, plan)
    elif not is_calm:
        assign_roles(n_walkers // 2, GUARD, UNREACHED, seat, sight, plan)
        assign_roles(2, HUNT, _NEAR, seat, sight, plan)
    _pair_up(seat, sight, rules, plan)
    if is_calm:
        lure(seat, sight, belief, rules, plan, orders)
    order_walkers(seat, sight, belief, rules, plan, WARY, BOLD, 1.0, orders)
    order_flyers(seat, sight, belief, rules, plan, orders)


@jit()
def _pair_up(seat: int, sight: Sight, rules: TeamRules, plan: Plan) -> None:
    """Give each unit on foot a mate of its role, those first that are nearest to each other; an odd one has none."""
    n_units, side = plan.role.shape[0], rules.side
    for _ in range(n_units // 2):
        one, two, least = -1, -1, 2 * side * side
        for unit in range(n_units):
            for other in range(unit):
                is_free = plan.mate[unit] < 0 and plan.mate[other] < 0
                far = squared(int(sight.cell[seat, unit]), int(sight.cell[seat, other]), side)
                if is_free and plan.role[unit] >= 0 and plan.role[unit] == plan.role[other] and far < least:
                    one, two, least = unit, other, far
        if one < 0:
            return
        plan.mate[one], plan.mate[two] = two, one


class Squad(BelievingPolicy):
    """Fights in pairs."""

    kernel = each_seat(__name__)
