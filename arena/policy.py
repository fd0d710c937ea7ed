"""The contract of every fighter.

A bot is one function in one file, `act(observation) -> actions`: one `Action` (0 stay, 1 north, 2 east, 3 south,
4 west) for each of `observation.units`, in their order. A bot with memory is a class instead: built anew for each match without
arguments, with the same `act`, and if it likes `start(info)` and `end(result)`.

Built-in fighters are `BatchPolicy`s: they act for many seats at once. `policies.registry` turns every kind into one.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
    """How a match ended."""

    ending: Termination
    winner: Team | None
    score: int
    """Blue's, in -100 .. 100; a policy is given its own (`seen_by`)."""
    ticks: int
    reason: str = ""
    """Why, where a match was forfeited or void."""

    def seen_by(self, team: Team) -> "MatchResult":
        """Return the result with `team`'s own score; of that one, with blue's again."""
        return self if team is Team.BLUE else replace(self, score=-self.score)

    def points(self, team: Team) -> float:
        """Return what the match is worth to a team: 1 for a win, 0.5 for a draw, 0 for a loss."""
        return 0.5 if self.winner is None else float(self.winner is team)

    def headline(self, blue: str = "blue", red: str = "red") -> str:
        """Return who won and how, as in "blue wins by forfeit (red vanished)"."""
        verdict = "draw" if self.winner is None else f"{(blue, red)[self.winner]} wins"
        return self._word(verdict) + self._how()

    def describe(self, team: Team | None = None) -> str:
        """Return how the match ended, as in "blue wins by capture after 12 ticks, score +100 for blue".

        For a `team`, whose own score the result then has: "win as blue by capture after 12 ticks, score +100".
        """
        after = f"after {self.ticks} ticks, score {self.score:+d}"
        if team is None:
            return f"{self.headline()} {after} for blue"
        verdict = "draw" if self.winner is None else "win" if self.winner is team else "loss"
        return f"{self._word(verdict)} as {team.name.lower()}{self._how()} {after}"

    def _word(self, verdict: str) -> str:
        return "void" if self.ending is Termination.VOID else verdict

    def _how(self) -> str:
        why = f" ({self.reason})" if self.reason else ""
        return why if self.ending is Termination.VOID else f" by {self.ending.name.lower().replace('_', ' ')}{why}"

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as journals, messages, stores and programs hold them."""
        return {
            "ending": self.ending.name.lower(),
            "winner": None if self.winner is None else self.winner.name.lower(),
            "score": self.score,
            "ticks": self.ticks,
            "reason": self.reason,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "MatchResult":
        """Read what `to_dict` wrote, whatever else is there; `KeyError` if a field is missing or no match ends like that."""
        winner = values["winner"]
        return cls(
            ending=Termination[values["ending"].upper()],
            winner=None if winner is None else Team[winner.upper()],
            score=values["score"],
            ticks=values["ticks"],
            reason=values["reason"],
        )


_MOST_ANSWER_LETTERS = 60
_NOT_IN_ORDER = (dict, set, frozenset)
"""What yields its keys, or its members in no order: numbers from 0 to 4 there are hardly the orders that were meant."""


class Policy(Protocol):
    """A fighter with memory, for one seat of one match; `start` and `end` may be left out."""

    def act(self, observation: Observation) -> Sequence[int]:
        """Return one action per own unit."""


Act = Callable[[Observation], Sequence[int]]
"""A fighter without memory."""


class Thinking(Exception):
    """A policy needs longer, as a person does, or a process: `start` or `act` is to be called again with the same arguments.

    A client that plays over the network calls again, many times if need be; no other venue does. `end` may come in between, and
    ends the match for the policy, whether `start` has returned or not.

    Parameters
    ----------
    has_seen
        The policy has taken in what it was shown and owes the answer alone; where no answer is of use any more, as with what it
        missed while it was away, it is not called again.
    """

    def __init__(self, *, has_seen: bool = False) -> None:
        super().__init__()
        self.has_seen = has_seen


class BatchPolicy(ABC):
    """A fighter for many seats at once, all of one team. Seats start and end independently of each other."""

    is_cheat: ClassVar[bool] = False
    """Whether the local venue shows it the whole board: a reference, never rated, that no other venue seats."""
    keeps_annotations: bool = False
    """Set before the first match by whoever takes what the fighter notes of its thinking; without that, it notes nothing."""
    explains: bool = False
    """Set beside `keeps_annotations` where somebody asks for what takes a fighter time to note: all that it believed, weighed and
    took. Its orders are the same either way."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        self.ruleset, self.team, self.n_seats = ruleset, team, n_seats

    def name_match(self, seat: int, match: str) -> None:
        """Hear, before `start`, what the match of `seat` is called: for what its author is told."""

    def set_turn_time(self, seconds: float) -> None:
        """Hear, before the first match, how long a turn may take, all that is done in it included; only where a clock runs."""

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

    def take_annotations(self, seat: int) -> bytes:
        """Return what `seat` noted in the last `act`, as `arena.annotations` packs it, and forget it."""
        return b""


MOST_REASONS = 8


@dataclass(slots=True, kw_only=True)
class Faults:
    """Ticks on which a seat's units stayed because its policy failed."""

    raised: int = 0
    illegal: int = 0
    """Answers that were not one action per unit."""
    first_traceback: str | None = None
    reasons: dict[str, tuple[str, int]] = field(default_factory=dict)
    """Why its units stayed: by kind, the sentence of the first time, which names the tick, and how often."""
    counted: dict[str, int] = field(default_factory=dict)
    """What else a league counts, by kind: limits that its process met, and that it was ended since it did not answer."""

    def note(self, kind: str, sentence: str, count: int = 1) -> None:
        """Count a reason; of many kinds, only the first `MOST_REASONS` are kept."""
        if kind in self.reasons or len(self.reasons) < MOST_REASONS:
            first, before = self.reasons.get(kind, (sentence, 0))
            self.reasons[kind] = first, before + count

    def add(self, later: "Faults") -> None:
        """Count what went wrong later, too."""
        self.raised += later.raised
        self.illegal += later.illegal
        self.first_traceback = self.first_traceback or later.first_traceback
        for kind, (sentence, count) in later.reasons.items():
            self.note(kind, sentence, count)
        for kind, count in later.counted.items():
            self.counted[kind] = self.counted.get(kind, 0) + count


BatchFactory = Callable[[Ruleset, Team, int], BatchPolicy]
"""Makes a fighter for a number of seats; it may carry `most_seats`, the most that suit it, and `close`, which ends what it has
started. `BatchPolicy` subclasses are factories themselves.
"""


def read_actions(answer: Any, n_units: int) -> NDArray[np.int8] | None:
    """Return an answer of `act` as int8, shape (n_units,), or None if it is not one action per unit, in their order."""
    if isinstance(answer, _NOT_IN_ORDER):
        return None
    try:
        values = [int(action) if action == int(action) else -1 for action in answer]
    except (TypeError, ValueError, OverflowError):
        return None
    if len(values) != n_units or not all(0 <= value <= 4 for value in values):
        return None
    return np.array(values, np.int8)


def explain_refusal(answer: Any, n_units: int) -> tuple[str, str]:
    """Return why an answer that `read_actions` refused is none: the kind of mistake, and a sentence's end that tells it."""
    if isinstance(answer, (str, bytes, *_NOT_IN_ORDER)) or not hasattr(answer, "__iter__"):
        return "form", f"{_shorten(answer)} is no list of orders"
    try:
        orders = list(answer)
    except Exception:  # noqa: BLE001 - a stranger's iterator may raise anything
        return "form", f"{_shorten(answer)} is no list of orders"
    if len(orders) != n_units:
        return "count", f"{len(orders)} orders for {n_units} units"
    wrong = next((unit for unit, order in enumerate(orders) if read_actions([order], 1) is None), 0)
    return "value", f"unit {wrong} is ordered {_shorten(orders[wrong])}, and an order is a number from 0 to 4"


def _shorten(answer: Any) -> str:
    text = " ".join(repr(answer).split())
    return text if len(text) <= _MOST_ANSWER_LETTERS else text[:_MOST_ANSWER_LETTERS] + "..."
