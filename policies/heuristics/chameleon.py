"""Plays as `role_team` for ten ticks, watching whether the enemy raids or guards its flag, then as the fighter that suits.

That is `squad` when neither was seen, else `role_team`; in one match of ten, any of the five at random.
"""

from arena.game.philox import below
from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw, one_in
from policies.heuristics import border_hunter, role_team, scout_rush, squad, turtle
from policies.heuristics.believing import BelievingPolicy, each_seat
from policies.tactics.roles import NEVER, Plan

_READS = 10
"""Ticks of reading."""
_ROLES, _SCOUTS, _PAIRS, _WAITS, _HUNTS = range(5)
_SURPRISE = 10
_STREAM = 1 << 20
"""The counter of the words of a choice, which no unit has."""


@jit()
def _choose(seat: int, sight: Sight, plan: Plan) -> int:
    words = draw(sight.seed[seat], _STREAM)
    if one_in(words[0], _SURPRISE):
        return int(below(words[1], 5))
    return _PAIRS if plan.raided_at[seat] == 0 and plan.guarded_at[seat] == NEVER else _ROLES


@jit()
def order_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    if sight.tick[seat] >= _READS and plan.choice[seat] < 0:
        plan.choice[seat] = _choose(seat, sight, plan)
    choice = plan.choice[seat]
    if choice == _SCOUTS:
        scout_rush.order_seat(seat, sight, belief, rules, plan, orders)
    elif choice == _PAIRS:
        squad.order_seat(seat, sight, belief, rules, plan, orders)
    elif choice == _WAITS:
        turtle.order_seat(seat, sight, belief, rules, plan, orders)
    elif choice == _HUNTS:
        border_hunter.order_seat(seat, sight, belief, rules, plan, orders)
    else:
        role_team.order_seat(seat, sight, belief, rules, plan, orders)


class Chameleon(BelievingPolicy):
    """Suits its enemy."""

    kernel = each_seat(__name__)
