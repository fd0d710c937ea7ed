"""Two pairs whose units keep within two cells of each other where ground and enemies let them; one guards, the other attacks.

They take a fight only where what they expect to lose is worth less than what they expect to win. Where nobody raids, both pairs
attack, and lure away the guards of the flag; ahead, both go home.
"""

from typing import Any

from arena.jit import jit
from arena.policy import Orders
from policies.belief import update_seat
from policies.believing import BelievingPolicy
from policies.bitrows import UNREACHED
from policies.luring import lure
from policies.memory import Sight
from policies.scouting import scout
from policies.tactics import ATTACK, BOLD, GUARD, WARY, appoint, march, survey

_CALM = 12
"""Ticks without an intruder after which both pairs attack."""


@jit()
def decide_seat(seat: int, sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, known, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    if sight.score[seat] > 0:
        appoint(n_walkers, GUARD, UNREACHED, seat, sight, plan)
    elif not is_calm:
        appoint(n_walkers // 2, GUARD, UNREACHED, seat, sight, plan)
    _pair_up(plan)
    if is_calm:
        lure(seat, sight, belief, known, plan, orders)
    march(seat, sight, belief, known, plan, WARY, BOLD, 1.0, orders)
    scout(seat, sight, belief, known, plan, orders)


@jit()
def _pair_up(plan: Any) -> None:
    """Give each unit on foot a mate of its role; the last of an odd number goes with the one before."""
    for role in (ATTACK, GUARD):
        alone = -1
        for unit in range(plan.role.shape[0]):
            if plan.role[unit] != role:
                continue
            if alone < 0:
                alone = unit
            else:
                plan.mate[unit], plan.mate[alone] = alone, unit
                alone = -1


@jit()
def _act(sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    for seat in range(orders.shape[0]):
        update_seat(seat, sight, belief, known)
        decide_seat(seat, sight, belief, known, plan, orders)


class Squad(BelievingPolicy):
    """Fights in pairs."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats."""
        _act(sight, self.belief, self.known, self.plan, orders)
