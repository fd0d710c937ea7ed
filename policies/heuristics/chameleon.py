"""For ten ticks it plays as `role_team` and reads the enemy: does it raid, does it guard its flag? Then it plays as who suits.

Where neither was seen that is `squad`, else `role_team` goes on; in one match of ten, any at random.
"""

from typing import Any

from arena.game.philox import below
from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import update_seat
from policies.belief.memory import Sight
from policies.chance import draw, one_in
from policies.heuristics import border_hunter, role_team, scout_rush, squad, turtle
from policies.heuristics.believing import BelievingPolicy
from policies.tactics.roles import NEVER

_READS = 10
"""Ticks of reading."""
_ROLES, _SCOUTS, _PAIRS, _WAITS, _HUNTS = range(5)
_SURPRISE = 10
_STREAM = 1 << 20
"""The counter of the words of a choice, which no unit has."""
_roles, _scouts, _pairs = role_team.decide_seat, scout_rush.decide_seat, squad.decide_seat
_waits, _hunts = turtle.decide_seat, border_hunter.decide_seat


@jit()
def _choose(seat: int, sight: Any, plan: Any) -> int:
    words = draw(sight.seed[seat], _STREAM)
    if one_in(words[0], _SURPRISE):
        return int(below(words[1], 5))
    return _PAIRS if plan.raided_at[seat] == 0 and plan.guarded_at[seat] == NEVER else _ROLES


@jit()
def _act(sight: Any, belief: Any, known: Any, plan: Any, orders: Any) -> None:
    for seat in range(orders.shape[0]):
        update_seat(seat, sight, belief, known)
        if sight.tick[seat] >= _READS and plan.choice[seat] < 0:
            plan.choice[seat] = _choose(seat, sight, plan)
        choice = plan.choice[seat]
        if choice == _SCOUTS:
            _scouts(seat, sight, belief, known, plan, orders)
        elif choice == _PAIRS:
            _pairs(seat, sight, belief, known, plan, orders)
        elif choice == _WAITS:
            _waits(seat, sight, belief, known, plan, orders)
        elif choice == _HUNTS:
            _hunts(seat, sight, belief, known, plan, orders)
        else:
            _roles(seat, sight, belief, known, plan, orders)


class Chameleon(BelievingPolicy):
    """Suits its enemy."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats."""
        _act(sight, self.belief, self.known, self.plan, orders)
