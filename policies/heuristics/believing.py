"""A fighter that keeps a belief for each of its seats, and plans from it."""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import BatchPolicy, Orders
from policies.belief.belief import forget, know, make_belief
from policies.belief.memory import Sight, sight_of
from policies.tactics.roles import NEVER, make_plan


class BelievingPolicy(BatchPolicy):
    """A fighter with a `Belief`, forgotten when a match begins."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        n_units = len(ruleset.team(team))
        self.known = know(ruleset, team)
        self.belief = make_belief(ruleset, team, n_seats)
        self.plan = make_plan(n_seats, n_units, ruleset.side**2)
        self._orders = np.zeros((n_seats, n_units), np.int8)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was believed there, and what was planned."""
        forget(self.belief, seats)
        self.plan.raided_at[seats] = 0
        self.plan.guarded_at[seats] = NEVER
        self.plan.choice[seats] = -1

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats."""
        self._orders[:] = 0
        self.decide(sight_of(observations), self._orders)
        orders[:] = self._orders

    @abstractmethod
    def decide(self, sight: Sight, orders: Orders) -> None:
        """Take in what is seen, and write the orders of all seats into contiguous memory that holds STAY."""
