"""Each tick, by the shortest ways, units become keeper, second guard, interceptor and attackers, who turn back from danger.

Where no intruder was seen for sixteen ticks all attack, warily, and lure away the guards of the flag; but an enemy that stays at
home may come at half time, and is awaited then. Once ahead all go home, but for who is about to take the flag.
"""

from typing import Any

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import update_seat
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.heuristics.believing import BelievingPolicy
from policies.tactics.luring import lure
from policies.tactics.roles import ATTACK, GUARD, HUNT, NEVER, WARY, appoint, march, survey
from policies.tactics.scouting import scout

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
def decide_seat(seat: int, sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, known, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    is_due = _EARLIEST * known.tick_limit <= sight.tick[seat] < _LATEST * known.tick_limit
    if is_due and plan.guarded_at[seat] != NEVER:
        is_calm = False
    life = WARY
    if sight.score[seat] > 0:
        life *= _HOLDS
        appoint_all_but_near(n_walkers, seat, sight, plan)
    elif not is_calm:
        n_guards = appoint(min(_GUARDS, n_walkers - 1), GUARD, UNREACHED, seat, sight, plan)
        if n_walkers - n_guards > 1 and appoint(1, HUNT, _NEAR, seat, sight, plan) == 0:
            appoint(1, GUARD, UNREACHED, seat, sight, plan)
    if is_calm:
        lure(seat, sight, belief, known, plan, orders)
    is_late = known.tick_limit - sight.tick[seat] < _LATE
    march(seat, sight, belief, known, plan, life, _KEEN, _HURRY if is_late and sight.score[seat] <= 0 else 1.0, orders)
    scout(seat, sight, belief, known, plan, orders)


@jit()
def appoint_all_but_near(n: int, seat: int, sight: Any, plan: Any) -> None:
    """Make every unit a guard that is not about to take the flag."""
    for unit in range(plan.role.shape[0]):
        if plan.role[unit] == ATTACK and plan.way[ATTACK, sight.cell[seat, unit]] > _SNATCH:
            plan.role[unit] = GUARD


@jit()
def _act(sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    for seat in range(orders.shape[0]):
        update_seat(seat, sight, belief, known)
        decide_seat(seat, sight, belief, known, plan, orders)


class RoleTeam(BelievingPolicy):
    """Plays for time and numbers."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats."""
        _act(sight, self.belief, self.known, self.plan, orders)
