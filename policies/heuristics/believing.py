"""A fighter that plans from a belief, one seat after another."""

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief, forget, make_belief
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.belief.update import update_seat
from policies.heuristics.compiled import CompiledPolicy
from policies.tactics.roles import Plan, forget_plan, make_plan


def each_seat(module: str) -> Callable[[Sight, Belief, Plan, TeamRules, Orders], None]:
    """Return the kernel that updates each seat's belief, and orders its units by a module's `order_seat`.

    `order_seat(seat, sight, belief, rules, plan, orders)` is compiled; it writes row `seat` of `orders`, which holds STAY.
    """
    script = sys.modules[module]

    def act(sight: Sight, belief: Belief, plan: Plan, rules: TeamRules, orders: Orders) -> None:
        orders[:] = 0
        for seat in range(orders.shape[0]):
            update_seat(seat, sight, belief, rules)
            script.order_seat(seat, sight, belief, rules, plan, orders)

    act.__qualname__ = f"act_{module.rpartition('.')[2]}"  # by which numba names its cache files: one for each fighter
    return jit()(act)


class BelievingPolicy(CompiledPolicy):
    """A fighter whose `kernel` is `each_seat` of its module. Its belief and plan are cleared when a match begins."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        self.belief = make_belief(ruleset, team, n_seats)
        self.plan = make_plan(n_seats, len(ruleset.team(team)), ruleset.side**2)
        super().__init__(ruleset, team, n_seats, self.belief, self.plan)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Clear what some seats believe and plan."""
        forget(self.belief, seats)
        forget_plan(self.plan, seats)
