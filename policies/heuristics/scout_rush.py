"""Units that fly sweep for the flag where it is likeliest; the nearest unit on foot runs for it round danger, and two trail it.

One guards. Where no intruder was seen for eight ticks it joins the run; guards of the flag are lured away first.
"""

from typing import Any

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import update_seat
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.heuristics.believing import BelievingPolicy
from policies.tactics.luring import lure
from policies.tactics.roles import BOLD, GUARD, WARY, appoint, march, survey
from policies.tactics.scouting import scout

_CALM = 8
"""Ticks without an intruder after which nobody stays to guard."""


@jit()
def decide_seat(seat: int, sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, known, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    if not is_calm and sight.score[seat] >= 0:
        appoint(min(1, n_walkers - 1), GUARD, UNREACHED, seat, sight, plan)
    if is_calm:
        lure(seat, sight, belief, known, plan, orders)
    march(seat, sight, belief, known, plan, WARY, BOLD, 1.0, orders)
    scout(seat, sight, belief, known, plan, orders)


@jit()
def _act(sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    for seat in range(orders.shape[0]):
        update_seat(seat, sight, belief, known)
        decide_seat(seat, sight, belief, known, plan, orders)


class ScoutRush(BelievingPolicy):
    """Runs first."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats."""
        _act(sight, self.belief, self.known, self.plan, orders)
