"""One guards the own flag, three its approaches; where somebody raids, three the flag, and the fourth meets whoever comes.

When ahead by two, all but one strike. From half time on, unless ahead, it attacks with all where nobody raids, and with all but
two where somebody does.
"""

from typing import Any

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import update_seat
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.heuristics.believing import BelievingPolicy
from policies.tactics.lanes import hold_lanes
from policies.tactics.roles import BOLD, GUARD, HUNT, WARY, appoint, march, survey
from policies.tactics.scouting import scout

_CALM, _STRIKE = 12, 20
"""Ticks without an intruder after which nobody need stay; and the score at which it strikes, two enemies ahead."""


@jit()
def decide_seat(seat: int, sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, known, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    is_ahead, is_half_time = sight.score[seat] > 0, 2 * sight.tick[seat] >= known.tick_limit
    n_guards = n_walkers
    if sight.score[seat] >= _STRIKE:
        n_guards = 1
    elif is_half_time and not is_ahead:
        n_guards = 0 if is_calm else 2
    if n_guards == n_walkers:
        appoint(1, HUNT, 2 * known.side, seat, sight, plan)
        if is_calm and not is_ahead:
            appoint(1, GUARD, UNREACHED, seat, sight, plan)
            hold_lanes(seat, sight, belief, known, plan)
    appoint(n_guards, GUARD, UNREACHED, seat, sight, plan)
    march(seat, sight, belief, known, plan, WARY, BOLD, 1.0, orders)
    scout(seat, sight, belief, known, plan, orders)


@jit()
def _act(sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    for seat in range(orders.shape[0]):
        update_seat(seat, sight, belief, known)
        decide_seat(seat, sight, belief, known, plan, orders)


class Turtle(BelievingPolicy):
    """Waits."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats."""
        _act(sight, self.belief, self.known, self.plan, orders)
