"""The contract of every fighter.

A bot is one function in one file, `act(observation) -> actions`: one `Action` (0 stay, 1 north, 2 east, 3 south,
4 west) for each of `observation.units`, in their order. A bot with memory is a class instead: built anew for each match without
arguments, with the same `act`, and if it likes `start(info)` and `end(result)`.

Built-in fighters are `BatchPolicy`s: they act for many seats at once. `policies.registry` turns every kind into one.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observation, Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination

Orders = NDArray[np.int8]
"""int8, shape (seats, units): one `Action` per unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchInfo:
    """What a policy is told before the first tick."""

    ruleset: Ruleset
    team: Team


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchResult:
    """What a policy is told after the last tick."""

    ending: Termination
    winner: Team | None
    score: int
    """The own score, in -100 .. 100."""
    ticks: int
    reason: str = ""
    """Why, where a match was forfeited or void."""

    def in_words(self) -> dict[str, Any]:
        """Return the facts as journals, messages and programs carry them."""
        return {
            "ending": self.ending.name.lower(),
            "winner": None if self.winner is None else self.winner.name.lower(),
            "score": self.score,
            "ticks": self.ticks,
            "reason": self.reason,
        }


class Policy(Protocol):
    """A fighter with memory, for one seat of one match; `start` and `end` may be left out."""

    def act(self, observation: Observation) -> Sequence[int]:
        """Return one action per own unit."""


Act = Callable[[Observation], Sequence[int]]
"""A fighter without memory."""


class BatchPolicy(ABC):
    """A fighter for many seats at once, all of one team. Seats start and end independently of each other."""

    is_cheat: ClassVar[bool] = False
    """Whether the local venue shows it the whole board: a reference, never rated, that no other venue seats."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        self.ruleset, self.team, self.n_seats = ruleset, team, n_seats

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what `seats` remember: a new match begins there."""

    @abstractmethod
    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats; shape (n_seats, own units). Only `observations` may be read."""

    def end(self, seat: int, result: MatchResult) -> None:
        """Hear how the match of `seat` ended."""

    def take_faults(self, seat: int) -> "Faults":
        """Return what went wrong on `seat` since its match began, and forget it. Our own fighters have no faults."""
        return Faults()


@dataclass(slots=True, kw_only=True)
class Faults:
    """Ticks on which a seat's units stayed because its policy failed."""

    raised: int = 0
    illegal: int = 0
    """Answers that were not one action per unit."""
    first_traceback: str | None = None


BatchFactory = Callable[[Ruleset, Team, int], BatchPolicy]
"""Makes a fighter for a number of seats; it may carry `most_seats`, the most that suit it. `BatchPolicy` subclasses are
factories themselves.
"""


def read_actions(answer: Any, n_units: int) -> NDArray[np.int8] | None:
    """Return an answer of `act` as int8, shape (n_units,), or None if it is not one action per unit."""
    try:
        values = [int(action) if action == int(action) else -1 for action in answer]
    except (TypeError, ValueError, OverflowError):
        return None
    if len(values) != n_units or not all(0 <= value <= 4 for value in values):
        return None
    return np.array(values, np.int8)
