"""Play a `BatchPolicy` from a file of its author's: what it raises, or writes instead of orders, costs its own seats alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.bot_calls import stacks
from arena.bot_calls.current import END, START, Place
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.policy import BatchPolicy, Faults, MatchResult, Orders
from policies.each_seat import UNREADABLE, call_bot, note_refusal

stacks.OURS.add(__file__)
_ARRAYS = [field.name for field in fields(Observations) if field.name not in ("team", "side")]


class GuardedBatch(BatchPolicy):
    """The seats of one team as a stranger's `BatchPolicy` plays them.

    It is shown the observations of all seats, also of those whose match has ended, in memory that it cannot write to. If it
    raises, all units of all its seats stay for a tick.
    """

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, *, make: type[BatchPolicy]) -> None:
        super().__init__(ruleset, team, n_seats)
        self._faults = [Faults() for _ in range(n_seats)]
        self._places = [Place("", team)] * n_seats
        self._is_running = np.zeros(n_seats, np.bool_)
        self._is_new = np.ones(n_seats, np.bool_)
        self._make = make
        self._policy: BatchPolicy | None = None
        self._turn_time_s: float | None = None

    def name_match(self, seat: int, match: str) -> None:
        """Hear what the match of `seat` is called."""
        self._places[seat] = Place(match, self.team)
        if self._policy is not None:
            self._call([seat], self._policy.name_match, seat, match)

    def set_turn_time(self, seconds: float) -> None:
        """Hear how long a turn may take."""
        self._turn_time_s = seconds

    def start(self, seats: NDArray[np.intp]) -> None:
        """Begin new matches, the first ones with a policy that is made now."""
        rows = np.arange(self.n_seats)[seats]
        self._is_running[rows], self._is_new[rows] = True, False
        for seat in rows.tolist():
            self._faults[seat] = Faults()
        if self._policy is None:
            self._policy = self._call(rows.tolist(), self._made)
        if self._policy is not None:
            self._call(rows.tolist(), self._policy.start, rows)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Ask the policy once for all seats; those that it gave no orders get `UNREADABLE`."""
        if (fresh := np.flatnonzero(self._is_new)).size:
            self.start(fresh)
        running = np.flatnonzero(self._is_running).tolist()
        given = np.full_like(orders, Action.STAY)
        if self._asks(running, _sealed(observations), given):
            is_wrong = ((given < min(Action)) | (given > max(Action))).any(axis=1)
            for seat in np.flatnonzero(is_wrong & self._is_running).tolist():
                note_refusal(self._faults[seat], given[seat].tolist(), given.shape[1], int(observations.tick[seat]))
                given[seat] = UNREADABLE
        else:
            given[:] = UNREADABLE
        orders[:] = np.where(self._is_running[:, None], given, Action.STAY)

    def end(self, seat: int, result: MatchResult) -> None:
        """End the match of `seat`."""
        if self._policy is not None:
            self._call([seat], self._policy.end, seat, result, ticks=np.full(self.n_seats, END))
        self._is_running[seat] = False

    def take_faults(self, seat: int) -> Faults:
        """Return what went wrong on `seat` since its match began, and forget it."""
        faults, self._faults[seat] = self._faults[seat], Faults()
        return faults

    def take_annotations(self, seat: int) -> bytes:
        """Return what the policy noted for `seat`, and forget it."""
        noted = None if self._policy is None else self._call([seat], self._policy.take_annotations, seat)
        return noted if isinstance(noted, bytes) else b""

    def _made(self) -> BatchPolicy:
        policy = self._make(self.ruleset, self.team, self.n_seats)
        policy.keeps_annotations, policy.explains = self.keeps_annotations, self.explains
        if self._turn_time_s is not None:
            policy.set_turn_time(self._turn_time_s)
        for seat, place in enumerate(self._places):
            policy.name_match(seat, place.match)
        return policy

    def _asks(self, running: Sequence[int], observations: Observations, given: Orders) -> bool:
        """Have the policy write its orders; whether it did so without a fault."""
        if self._policy is None:  # its constructor raised, which was shown then
            for seat in running:
                self._faults[seat].raised += 1
            return False
        policy = self._policy

        def ask() -> bool:
            policy.act(observations, given)
            return True

        return bool(self._call(running, ask, ticks=observations.tick))

    def _call(self, seats: Sequence[int], method: Callable[..., Any], *arguments: Any, ticks: NDArray[Any] | None = None) -> Any:
        place = self._places[seats[0]] if seats else Place("", self.team)
        faults = [(self._faults[seat], START if ticks is None else int(ticks[seat])) for seat in seats]
        return call_bot(place, faults, method, *arguments)


@dataclass(frozen=True, slots=True)
class GuardedBatchFactory:
    """The `BatchFactory` of a stranger's `BatchPolicy`, which may say `most_seats` itself."""

    make: type[BatchPolicy]

    @property
    def most_seats(self) -> int:
        """How many seats it plays at once."""
        return int(getattr(self.make, "most_seats", 256))

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        """Return the policy of some seats."""
        return GuardedBatch(ruleset, team, n_seats, make=self.make)


def _sealed(observations: Observations) -> Observations:
    """Return observations that cannot be written to: some are the very memory of the games."""
    arrays = {name: getattr(observations, name).view() for name in _ARRAYS}
    for array in arrays.values():
        array.flags.writeable = False
    return replace(observations, **arrays)
