"""One match as a state machine without I/O: orders and the time go in, effects come out.

Nothing here knows of a network, a file or a clock; `now_s` is whatever the caller's clock reads. The caller carries the effects
of a call out in their order, which puts each tick into the journal before anything is sent of the next.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from arena.errors import JournalError
from arena.game.engine import BatchedGame
from arena.game.state import StateField
from arena.game.types import Action, Team, Termination
from arena.match.effects import Ask, Effect, End, Publish, Write
from arena.match.seat_clock import SeatClock
from arena.match.seat_record import SeatRecord
from arena.match.shown_again import show_again
from arena.match.time_control import TimeControl
from arena.policy import MatchResult
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal import CHAIN_BYTES, Header, Journal, Mark, write_ending, write_start, write_tick
from arena.records.replay import match_result

_STAY = bytes([Action.STAY])
_EFFECT = bytes(byte if byte < len(Action) else Action.STAY for byte in range(256))
"""What each byte of an answer does to a unit: one that is no action leaves it where it is."""
WIN = 100
"""Score of a match that was forfeited, from the winner's side."""


class Phase(Enum):
    """Where a match stands."""

    WAITING = "for both seats to be ready"
    PLAYING = "playing"
    OVER = "over"


_NO_MARK = Mark(0)


@dataclass(slots=True, kw_only=True)
class _Seat:
    """Where one seat stands in the current tick."""

    team: Team
    n_units: int
    sight: ObservationWriter
    clock: SeatClock
    answer: bytes
    mark: Mark = _NO_MARK
    shown: bytes = b""
    """The observation of the current tick."""
    past: list[bytes] | None = None
    """Those before, once the seat came back for the first time."""
    banks_s: list[float] = field(default_factory=list)
    """The extra time that was left at each tick, which observations say."""
    is_ready: bool = False
    has_answered: bool = False
    missed: int = 0
    late_ticks: set[int] = field(default_factory=set)
    """Ticks that were ruled late, and whose answer has not come yet."""
    record: SeatRecord = field(default_factory=SeatRecord)


class Match:
    """A match, from its drawn board to its ending."""

    def __init__(self, header: Header, time_control: TimeControl, now_s: float) -> None:
        self.header, self.time_control = header, time_control
        self._has_clock = time_control.turn_time_s is not None
        self.phase = Phase.WAITING
        self._drawn_at_s = now_s
        self.result: MatchResult | None = None
        self.head = b""
        """The last link of the chain, once the match is over."""
        self._games = BatchedGame(header.ruleset, 1)
        self._games.start([0], [header.keys])
        n_units = self._games.n_units
        self._seats = {
            team: _Seat(
                team=team,
                n_units=n_units[team],
                sight=ObservationWriter(seen, 0),
                clock=SeatClock(time_control, now_s),
                answer=_STAY * n_units[team],
            )
            for team, seen in self._games.observe().items()
        }
        self._blue, self._red = self._seats.values()
        self._state = self._games.digestible_views(0)
        self._past: list[bytes] = []
        self.start_record, self._chain = write_start(header, self._games.state.ground[0].tobytes(), b"".join(self._state))
        self._show()

    @property
    def tick(self) -> int:
        """Ticks played so far."""
        return len(self._past)

    @property
    def facts(self) -> tuple[int, int, int]:
        """Blue's living units, red's, and blue's score: public by rule."""
        field = self._games.state.field[0]
        return int(field[StateField.BLUE_LIVING]), int(field[StateField.RED_LIVING]), int(field[StateField.SCORE])

    def history(self, team: Team, known_ticks: int) -> tuple[list[bytes], list[bytes]]:
        """Return the observations of a seat's answered ticks from `known_ticks` on, and the orders that were played."""
        seat = self._seats[team]
        if seat.past is None:
            seat.past = show_again(self.header, self._past, team, seat.banks_s if self._has_clock else None)
        return seat.past[known_ticks:], [self._split(orders)[team] for orders in self._past[known_ticks:]]

    def n_shown_bytes(self, team: Team) -> int:
        """Return the length of every observation of a seat."""
        return len(self._seats[team].shown)

    def truth(self) -> tuple[bytes, list[bytes]]:
        """Return the true board in the codes of Table 2, and what each seat is shown of it."""
        return self._games.truth(0).tobytes(), [seat.shown for seat in self._seats.values()]

    def unready_s(self, now_s: float) -> float:
        """Return how long the match has waited for both seats to be ready; 0 once it began."""
        return now_s - self._drawn_at_s if self.phase is Phase.WAITING else 0.0

    @property
    def due_s(self) -> float:
        """When `advance` may have something to do, unless something is received before: never sooner than this."""
        if self.phase is Phase.OVER:
            return math.inf
        is_playing = self.phase is Phase.PLAYING
        return min(seat.clock.due_s(is_asked=is_playing and not seat.has_answered) for seat in self._seats.values())

    def is_away(self, team: Team) -> bool:
        """Whether a seat has not come yet, or has vanished."""
        return self._seats[team].clock.is_away

    def record(self, team: Team) -> SeatRecord:
        """Return what was counted of a seat."""
        return self._seats[team].record

    def recover(self, journal: Journal) -> list[Effect]:
        """Play the ticks that a journal holds, and count what was ruled in them; called before any seat is ready.

        No time is charged for them: the pit was away, not the seats.

        Raises
        ------
        JournalError
            A state differs from the journal's.
        """
        if self._chain != journal.start_chain:
            raise JournalError("the journal was changed: its board is another")
        for number, record in enumerate(journal.ticks, start=1):
            for seat, answer, mark in zip(self._seats.values(), self._split(record.orders), record.marks, strict=True):
                seat.answer, seat.mark = answer, mark
                seat.missed = seat.missed + 1 if Mark.LATE in mark else 0
            is_over = self._games.has_ended(0)
            self._play_tick()
            if is_over or self._chain != record.chain:
                raise JournalError(f"the journal was changed: at tick {number} its orders or its state are others")
        return self._end(match_result(self._games, 0)) if self._games.has_ended(0) else []

    def ready(self, team: Team, now_s: float) -> list[Effect]:
        """A seat is ready: at first, or after it was away. It is asked at once if the match waits for it."""
        seat = self._seats[team]
        if self.phase is Phase.OVER:
            return []
        seat.clock.go_on(now_s)
        seat.is_ready = True
        if self.phase is Phase.WAITING:
            if not all(seat.is_ready for seat in self._seats.values()):
                return []
            self.phase = Phase.PLAYING
            for other in self._seats.values():
                other.clock.renew_grace()
            return self._ask_all(now_s)
        return [] if seat.has_answered else [self._ask(seat, is_new=False)]

    def catch_up(self, team: Team, n_ticks: int, now_s: float) -> list[Effect]:
        """A seat is there, and sees `n_ticks` of its history: the match waits until it is ready, or its time for that is over."""
        if self.phase is Phase.OVER or self._seats[team].clock.catch_up(n_ticks, self.tick, now_s):
            return []
        return self.ready(team, now_s)

    def leave(self, team: Team, now_s: float) -> list[Effect]:
        """A seat has vanished; its clock stops, and its grace runs."""
        seat = self._seats[team]
        if self.phase is not Phase.OVER and not seat.clock.is_away:
            seat.clock.leave(now_s)
            seat.is_ready = False
            seat.record.vanished += 1
        return []

    def submit(self, team: Team, tick: int, actions: bytes, now_s: float, arrived_s: float | None = None) -> list[Effect]:
        """Take a seat's orders; the first readable message of a tick counts, and what it lacks means to stay.

        The seat is charged until `arrived_s`, if the orders lay there before they were taken up `now_s`.
        """
        seat = self._seats[team]
        answer = actions[: seat.n_units].translate(_EFFECT).ljust(seat.n_units, _STAY)
        if self.phase is not Phase.PLAYING or tick != self.tick or seat.has_answered:
            self._ignore(seat, tick, answer)
            return []
        seat.clock.go_on(now_s)  # it was reported gone, and is not
        seat.answer = answer
        if answer != actions:
            seat.mark |= Mark.UNREADABLE
        seat.record.latencies_s.append(seat.clock.charge(now_s if arrived_s is None else arrived_s))
        seat.has_answered, seat.missed = True, 0
        return self._turn(now_s) if self._is_complete() else []

    def note_sent(self, team: Team, now_s: float) -> None:
        """A new turn of a seat was sent only now, a moment after it was asked: its clock begins here."""
        seat = self._seats[team]
        if self.phase is Phase.PLAYING and seat.clock.is_running and not seat.has_answered:
            seat.clock.begin_turn(now_s)

    def count_stale(self, team: Team) -> None:
        """Count a readable message of a seat that the match has no use for."""
        self._seats[team].record.stale += self.phase is not Phase.OVER

    def count_garbled(self, team: Team) -> None:
        """Count a message that was none."""
        self._seats[team].record.garbled += self.phase is not Phase.OVER

    def count_forged(self, team: Team) -> None:
        """Count a message that another made."""
        self._seats[team].record.forged += self.phase is not Phase.OVER

    def advance(self, now_s: float) -> list[Effect]:
        """Let time pass: rule on seats that are late, or away for too long."""
        if self.phase is Phase.OVER:
            return []
        gone = [team for team, seat in self._seats.items() if seat.clock.is_gone(now_s)]
        if gone:
            # Whoever is away as well has not come to fight either: nobody wins by being gone a moment later.
            gone = [team for team, seat in self._seats.items() if seat.clock.is_away]
            is_playing = self.phase is Phase.PLAYING
            return self._forfeit(gone, "did not come back in time" if is_playing else "did not get ready in time")
        effects: list[Effect] = []
        for seat in self._seats.values():
            if seat.clock.catches_up_too_long(now_s):
                effects += self.ready(seat.team, now_s)
        if self.phase is Phase.WAITING:
            return effects
        for seat in self._seats.values():
            if seat.has_answered or not seat.clock.is_late(now_s):
                continue
            seat.answer = _STAY * seat.n_units
            seat.mark |= Mark.LATE
            seat.missed += 1
            seat.clock.charge_all()
            seat.has_answered = True
            seat.late_ticks.add(self.tick)
        idle = [seat.team for seat in self._seats.values() if seat.missed >= self.time_control.most_missed]
        if idle:
            return effects + self._forfeit(idle, f"missed {self.time_control.most_missed} turns in a row")
        return effects + self._turn(now_s) if self._is_complete() else effects

    def forfeit(self, team: Team, why: str) -> list[Effect]:
        """End the match against a seat."""
        return [] if self.phase is Phase.OVER else self._forfeit([team], why)

    def void(self, reason: str) -> list[Effect]:
        """End the match by a fault of the pit's own."""
        return self._end(MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=self.tick, reason=reason))

    def _ignore(self, seat: _Seat, tick: int, answer: bytes) -> None:
        """Count orders that the match has no use for, unless they are late, or a copy."""
        if tick in seat.late_ticks:
            seat.late_ticks.remove(tick)
            return
        counted = None
        if 0 <= tick < self.tick:
            counted = self._split(self._past[tick])[seat.team]
        elif tick == self.tick and seat.has_answered:
            counted = seat.answer
        if answer != counted:
            self.count_stale(seat.team)

    def _is_complete(self) -> bool:
        return self._blue.has_answered and self._red.has_answered

    def _turn(self, now_s: float) -> list[Effect]:
        """Play the tick that both have answered, and ask for the next."""
        write = Write(data=self._play_tick())
        if self._games.has_ended(0):
            return [write, *self._end(match_result(self._games, 0))]
        return [write, *self._ask_all(now_s)]

    def _split(self, orders: bytes) -> tuple[bytes, bytes]:
        """Return blue's part of a tick's orders, and red's."""
        return orders[: self._blue.n_units], orders[self._blue.n_units :]

    def _play_tick(self) -> bytes:
        """Step, and return the tick's record."""
        orders = self._blue.answer + self._red.answer
        self._games.play(np.frombuffer(orders, np.int8)[None])
        self._past.append(orders)
        marks = bytes((self._blue.mark, self._red.mark))
        record, self._chain = write_tick(self._chain, orders, marks, b"".join(self._state))
        for seat in self._seats.values():
            if seat.mark:  # counted here, so that a journal and who recovers from it count alike
                seat.record.late += Mark.LATE in seat.mark
                seat.record.unreadable += Mark.UNREADABLE in seat.mark
                seat.mark = _NO_MARK
        self._show()
        return record

    def _show(self) -> None:
        """Write what each seat is to see of the tick that begins."""
        for seat in self._seats.values():
            if seat.past is not None:
                seat.past.append(seat.shown)
            if self._has_clock:
                seat.banks_s.append(seat.clock.bank_s)
                seat.sight.set_clock(seat.clock.bank_s)
            seat.shown = seat.sight.write()

    def _ask_all(self, now_s: float) -> list[Effect]:
        effects: list[Effect] = []
        for seat in self._seats.values():
            seat.has_answered = False
            seat.clock.begin_turn(now_s)
            if seat.clock.is_running:
                effects.append(self._ask(seat, is_new=True))
        return [*effects, Publish()]

    def _ask(self, seat: _Seat, *, is_new: bool) -> Ask:
        return Ask(seat.team, len(self._past), seat.shown, seat.clock.charged_us, is_new)

    def _forfeit(self, losers: Iterable[Team], why: str) -> list[Effect]:
        teams = list(losers)
        winner = teams[0].other if len(teams) == 1 else None
        score = 0 if winner is None else WIN if winner is Team.BLUE else -WIN
        names = " and ".join(team.name.lower() for team in teams)
        return self._end(
            MatchResult(ending=Termination.FORFEIT, winner=winner, score=score, ticks=self.tick, reason=f"{names} {why}")
        )

    def _end(self, result: MatchResult) -> list[Effect]:
        self.phase, self.result = Phase.OVER, result
        record = write_ending(self._chain, result)
        self.head = record[-CHAIN_BYTES:]
        return [Write(data=record), End(result=result)]
