"""Two pairs whose units keep within two cells of each other where ground and enemies let them; one guards, the other attacks.

They take a fight only where what they expect to lose is worth less than what they expect to win. Where nobody raids, both pairs
attack, and lure away the guards of the flag; ahead, both go home.
"""

from typing import Any

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import update_seat
from policies.belief.bitrows import UNREACHED
from policies.belief.memory import Sight
from policies.heuristics.believing import BelievingPolicy
from policies.tactics.luring import lure
from policies.tactics.odds import squared
from policies.tactics.roles import BOLD, GUARD, HUNT, WARY, appoint, march, survey
from policies.tactics.scouting import scout

_CALM, _NEAR = 12, 8
"""Ticks without an intruder after which both pairs attack; and how near an intruder must come for both to be at home."""


@jit()
def decide_seat(seat: int, sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    """Write the orders of one seat, whose belief is up to date."""
    n_walkers = survey(seat, sight, belief, known, plan)
    is_calm = sight.tick[seat] - plan.raided_at[seat] >= _CALM
    if sight.score[seat] > 0:
        appoint(n_walkers, GUARD, UNREACHED, seat, sight, plan)
    elif not is_calm:
        appoint(n_walkers // 2, GUARD, UNREACHED, seat, sight, plan)
        appoint(2, HUNT, _NEAR, seat, sight, plan)
    _pair_up(seat, sight, known, plan)
    if is_calm:
        lure(seat, sight, belief, known, plan, orders)
    march(seat, sight, belief, known, plan, WARY, BOLD, 1.0, orders)
    scout(seat, sight, belief, known, plan, orders)


@jit()
def _pair_up(seat: int, sight: Any, known: Any, plan: Any) -> None:
    """Give each unit on foot a mate of its role, those first that are nearest to each other; an odd one has none."""
    n_units, side = plan.role.shape[0], known.side
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
