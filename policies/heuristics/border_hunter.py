"""One keeps the own flag, and the others the lanes of the own half until somebody is seen to come: then at least two hunt.

Ahead, it rushes with two where nobody raids. From half time on, unless ahead, it attacks with all but the keeper, and with the
keeper too where nobody raids.
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

_CALM = 12
"""Ticks without an intruder after which nobody need stay."""


@jit()
def decide_seat(seat: int, sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, known, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    is_ahead, is_half_time = sight.score[seat] > 0, 2 * sight.tick[seat] >= known.tick_limit
    is_attack = is_half_time and not is_ahead
    if not (is_attack and is_calm):
        appoint(1, GUARD, UNREACHED, seat, sight, plan)
    if is_calm and not is_attack and not is_ahead:
        hold_lanes(seat, sight, belief, known, plan)
    if not is_attack:
        appoint(max(2, n_walkers - 2), HUNT, UNREACHED, seat, sight, plan)
        n_rush = 2 if is_ahead and is_calm else 0
        appoint(n_walkers - 1 - n_rush, GUARD, UNREACHED, seat, sight, plan)
    march(seat, sight, belief, known, plan, WARY, BOLD, 1.0, orders)
    scout(seat, sight, belief, known, plan, orders)


@jit()
def _act(sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    for seat in range(orders.shape[0]):
        update_seat(seat, sight, belief, known)
        decide_seat(seat, sight, belief, known, plan, orders)


class BorderHunter(BelievingPolicy):
    """Hunts at home."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats."""
        _act(sight, self.belief, self.known, self.plan, orders)
