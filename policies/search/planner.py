"""Looks ahead: it plays what its units could do on, in many worlds that may be, and leaves `role_team` for what wins more.

Budgets count playouts, not time, so that its orders follow from what it was shown alone.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import BatchPolicy, Orders
from policies.search.climb import Effort
from policies.search.mind import Mind

MOST_SIDE = 40
"""The largest board on which ways between all cells are worth their search."""


class Planner(BatchPolicy):
    """Thinks about 25 ms a tick."""

    effort: ClassVar[Effort] = Effort(budget=900)
    n_worlds: ClassVar[int] = 128
    n_lines: ClassVar[int] = 1
    most_seats: ClassVar[int] = 8
    """It takes long: so many at once, that the first matches end soon."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._minds = [Mind(ruleset, team, self.n_worlds, self.n_lines) for _ in range(n_seats)]
        self._pool = ThreadPoolExecutor(len(os.sched_getaffinity(0))) if self.n_lines > 1 else None

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what some seats have in mind."""
        for seat in np.arange(self.n_seats)[seats].tolist():
            self._minds[seat].start()

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats."""
        for seat, mind in enumerate(self._minds):
            orders[seat] = mind.act(observations.select(slice(seat, seat + 1)), self.effort, self._pool)


class PlannerFast(Planner):
    """Thinks about 5 ms a tick."""

    effort = Effort(budget=200)
    n_worlds = 64


class PlannerDeep(Planner):
    """Thinks about 200 ms a tick, less where it is given several cores."""

    effort = Effort(budget=6000, most=256, more=48, few=16)
    n_worlds = 256
    n_lines = 4
    most_seats = 2
