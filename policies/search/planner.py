"""Looks ahead: it plays what its units could do on, in many worlds that may be, and leaves `role_team` for what wins more.

Budgets count playouts, not time, so that its orders follow from what it was shown alone. Where a clock is too short for its
budget, it measures itself once, and thinks less.
"""

import logging
import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from arena.errors import PolicyError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import BatchPolicy, Orders
from policies.search.budget import describe_budget, fit_budget, make_opening
from policies.search.climb import Effort
from policies.search.explain import explain
from policies.search.mind import Mind
from policies.settings import read_settings

logger = logging.getLogger(__name__)
MOST_SIDE = 40
"""The largest board on which the ways between all cells are worth their search."""
LEAST_BUDGET = 40
"""Playouts with which a plan can be told from another at all."""
_BLUEPRINT = "role_team"


class Planner(BatchPolicy):
    """Looks ahead as `planner-fast` does, for about 25 ms a tick."""

    name: ClassVar[str] = "planner"
    budget: ClassVar[int] = 800
    """Playouts a tick."""
    settings: ClassVar[Mapping[str, Any]] = {}
    """Other values for fields of `Effort`."""
    n_worlds: ClassVar[int] = 128
    n_lines: ClassVar[int] = 1
    most_seats: ClassVar[int] = 8
    """It takes long: so many at once, so that the first matches end soon."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._effort = self.effort_of(self.budget if can_look_ahead(self.name, ruleset) else 0)
        self._minds = [Mind(ruleset, team, self.n_worlds, self.n_lines) for _ in range(n_seats)]
        self._pool = _make_pool(type(self))
        self._notes = [b""] * n_seats

    @classmethod
    def effort_of(cls, budget: int) -> Effort:
        """Return how it spends a budget of playouts."""
        return Effort.of(budget)._replace(**cls.settings)

    @classmethod
    def with_settings(cls, text: str) -> "type[Planner]":
        """Return this planner with another budget, as in "2000", or with other settings, as in "budget=2000,hold=12".

        Raises
        ------
        PolicyError
            There is no such setting, or no such value of it.
        """
        settings = read_settings(cls.name, text if "=" in text else f"budget={text}", cls.effort_of(cls.budget)._asdict())
        budget = int(settings.pop("budget", cls.budget))
        if budget < LEAST_BUDGET:
            raise PolicyError(
                f"{cls.name}:{text} has a budget of {budget} playouts; {LEAST_BUDGET} is the least that tells plans apart"
            )
        return type(cls.__name__, (cls,), {"budget": budget, "settings": {**cls.settings, **settings}, "__module__": __name__})

    def set_turn_time(self, seconds: float) -> None:
        """Think no longer than a turn leaves room for."""
        if self._effort.budget:
            self._effort = self.effort_of(_fit(type(self), self.ruleset, self.team, seconds))

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what some seats have in mind."""
        for seat in np.arange(self.n_seats)[seats].tolist():
            self._minds[seat].start()

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats."""
        for seat, mind in enumerate(self._minds):
            orders[seat] = mind.act(observations.select(slice(seat, seat + 1)), self._effort, self._pool)
            if self.keeps_annotations and self.explains:
                self._notes[seat] = explain(mind.tell()).pack() if self._effort.budget else b""

    def hear(self, seat: int, orders: NDArray[np.int8]) -> None:
        """Hear which orders were carried out in place of those that a seat gave in the last `act`: a learner's."""
        self._minds[seat].hear(orders)

    def first_steps(self, seat: int) -> NDArray[np.float32]:
        """Return the chances that a seat gave each order in the last `act`, float32 of shape (own units, actions)."""
        return self._minds[seat].first_steps()

    def take_annotations(self, seat: int) -> bytes:
        """Return what a seat thought in the last `act`, and forget it."""
        taken, self._notes[seat] = self._notes[seat], b""
        return taken


class PlannerFast(Planner):
    """Looks ahead: it plays on what its units could do, in worlds that may be, for about 5 ms a tick."""

    name = "planner-fast"
    budget = 160
    n_worlds = 64


class PlannerDeep(Planner):
    """Looks ahead as `planner-fast` does, for about 200 ms a tick on one core, less on several."""

    name = "planner-deep"
    budget = 6000
    n_worlds = 256
    n_lines = 4
    most_seats = 2


def _make_pool(planner: type[Planner]) -> ThreadPoolExecutor | None:
    """Return what carries a planner's lines of thought, if it has several: as many threads as there are processors."""
    return ThreadPoolExecutor(len(os.sched_getaffinity(0)), thread_name_prefix=planner.name) if planner.n_lines > 1 else None


@cache
def can_look_ahead(name: str, ruleset: Ruleset) -> bool:
    """Whether a fighter that needs the ways between all cells can look ahead under a ruleset; said once if not."""
    if ruleset.side > MOST_SIDE:
        logger.warning(
            "%s: it looks ahead on boards of up to %d cells a side, and %s has %d; it plays the orders of %s",
            name, MOST_SIDE, ruleset.name, ruleset.side, _BLUEPRINT,
        )  # fmt: skip
    return ruleset.side <= MOST_SIDE


@cache
def _fit(planner: type[Planner], ruleset: Ruleset, team: Team, seconds: float) -> int:
    """Return how many playouts a planner has time for; measured once in a process, and said where its budget does not fit."""
    mind, opening, pool = Mind(ruleset, team, planner.n_worlds, planner.n_lines), make_opening(ruleset, team), _make_pool(planner)
    fits = fit_budget(lambda n: mind.act(opening, planner.effort_of(n), pool), planner.budget, LEAST_BUDGET, seconds)
    sentence = describe_budget(planner.name, fits, planner.budget, LEAST_BUDGET, seconds, _BLUEPRINT)
    if sentence:
        logger.warning(sentence)
    return fits
