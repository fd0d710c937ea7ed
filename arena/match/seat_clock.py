"""The time of one seat in one match: its turns, its bank, its grace, and what it may take to see its history again.

The clock of a turn runs while the seat is there and has seen all before that turn, and stands otherwise.
"""

import math

from arena.match.time_control import TimeControl
from arena.protocol.messages import MOST_US, UNKNOWN_US

_ROUNDING_S = 1e-6
"""More than sums and differences of times are rounded by."""


class SeatClock:
    """Begins with a seat that has not come yet. `now_s` never goes back."""

    def __init__(self, time_control: TimeControl, now_s: float) -> None:
        self._time_control = time_control
        self.bank_s = time_control.bank_s
        """Extra time that is left."""
        self._grace_s = time_control.grace_s
        self._away_since_s: float | None = now_s
        self._catching_up_since_s: float | None = None
        self._catching_up_until_s = 0.0
        self._caught_up_s = 0.0
        """Spent on seeing ticks again, in the whole match."""
        self._asked_at_s = 0.0
        self.charged_us = UNKNOWN_US
        """For the turn that was answered, or ruled late, last."""

    @property
    def is_away(self) -> bool:
        """Whether the seat has not come yet, or has vanished."""
        return self._away_since_s is not None

    @property
    def is_running(self) -> bool:
        """Whether the seat is there, and has seen all before the current turn."""
        return self._away_since_s is None and self._catching_up_since_s is None

    def begin_turn(self, now_s: float) -> None:
        """A turn begins."""
        self._asked_at_s = now_s

    def leave(self, now_s: float) -> None:
        """The seat has vanished: its grace runs."""
        self.go_on(now_s)
        self._away_since_s = now_s

    def go_on(self, now_s: float) -> None:
        """The seat is there and has seen all: charge the time that it was away or caught up; its turn goes on from there."""
        if self._away_since_s is not None:
            self._grace_s -= now_s - self._away_since_s
            self._skip(self._away_since_s, now_s)
            self._away_since_s = None
        if self._catching_up_since_s is not None:
            self._caught_up_s += now_s - self._catching_up_since_s
            self._skip(self._catching_up_since_s, now_s)
            self._catching_up_since_s = None

    def catch_up(self, n_ticks: int, n_played: int, now_s: float) -> bool:
        """The seat is there, and sees `n_ticks` of `n_played` again; return False if it has no time left for that.

        It may take its turn time for each of these ticks, and in the whole match for each that was played, however often it comes
        back.
        """
        self.go_on(now_s)
        turn_time_s = math.inf if self._time_control.turn_time_s is None else self._time_control.turn_time_s
        left_s = min(n_ticks * turn_time_s, n_played * turn_time_s - self._caught_up_s)
        if left_s <= 0.0:
            return False
        self._catching_up_since_s, self._catching_up_until_s = now_s, now_s + left_s
        return True

    def catches_up_too_long(self, now_s: float) -> bool:
        """Whether the seat still catches up, and has used its time for that."""
        return self._catching_up_since_s is not None and now_s >= self._catching_up_until_s

    def renew_grace(self) -> None:
        """Both seats have come, and the match begins."""
        self._grace_s = self._time_control.grace_s

    def is_gone(self, now_s: float) -> bool:
        """Whether the seat is away for too long."""
        return self._away_since_s is not None and now_s - self._away_since_s >= self._grace_s

    def is_late(self, now_s: float) -> bool:
        """Whether the turn is over without an answer."""
        turn_time_s = self._time_control.turn_time_s
        return turn_time_s is not None and self.is_running and now_s >= self._asked_at_s + turn_time_s + self.bank_s

    def due_s(self, *, is_asked: bool) -> float:
        """Return when there may be something to rule on next; `is_asked` says whether the seat owes an answer."""
        if self._away_since_s is not None:
            return self._away_since_s + self._grace_s - _ROUNDING_S
        if self._catching_up_since_s is not None:
            return self._catching_up_until_s
        turn_time_s = self._time_control.turn_time_s
        return math.inf if turn_time_s is None or not is_asked else self._asked_at_s + turn_time_s + self.bank_s

    def charge(self, answered_at_s: float) -> float:
        """Charge the turn for what it took, and the bank for what that was beyond its time; return what it took."""
        took_s = max(answered_at_s - self._asked_at_s, 0.0)
        self._charge(took_s)
        turn_time_s = self._time_control.turn_time_s
        if turn_time_s is not None and took_s > turn_time_s:
            self.bank_s = max(self.bank_s - (took_s - turn_time_s), 0.0)
        return took_s

    def charge_all(self) -> None:
        """Charge a turn without an answer: all of its time, and the whole bank."""
        self._charge((self._time_control.turn_time_s or 0.0) + self.bank_s)
        self.bank_s = 0.0

    def _charge(self, took_s: float) -> None:
        self.charged_us = min(round(took_s * 1e6), MOST_US)

    def _skip(self, since_s: float, now_s: float) -> None:
        self._asked_at_s += now_s - max(since_s, self._asked_at_s)
