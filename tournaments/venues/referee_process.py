"""The referee of a league in a process of its own, and what it and the scheduler tell each other, over one pipe.

Of what the referee is told, one message is under way at a time, and it answers each: so that neither side ever waits for the
other to read. It ends by itself when the scheduler is gone.
"""

import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection

from arena.console import set_up_logging
from arena.errors import ArenaError, InputError
from arena.game.engine import warm
from arena.keyring.files import load_or_make
from arena.local.workers import follow_parent
from arena.match.seat_record import SeatRecord
from arena.network.address import Address
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.register import Register
from arena.pit.seating import PlannedSeating
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.processes import GOODBYE_S, RestartLimit
from tournaments.venues.setting import VenueSetting

MOST_PLANS = 200
"""In a message: it fits a pipe that is empty, and takes the referee less time than a turn."""
OPEN_WITHIN_S = 600.0
"""For a referee to open its pit: it compiles its kernels first, if need be, on cores that may be busy."""
_REFEREE_LOG = "pit.referee.log"  # no label of an entry ends in that


@dataclass(frozen=True, slots=True, kw_only=True)
class Addition:
    """Entries and matches that come while the pit is open, or all that there are when it opens."""

    names: Mapping[str, bytes]
    """The public keys of entries."""
    remote: frozenset[str]
    """Those of them that join by themselves; the referee tells when they wait."""
    plans: Sequence[MatchPlan]


@dataclass(frozen=True, slots=True)
class Dismissal:
    """An entry is to be sent home as soon as it asks again."""

    name: str


@dataclass(frozen=True, slots=True)
class Call:
    """An entry that may have been dismissed is to be seated again."""

    name: str


@dataclass(frozen=True, slots=True)
class Withdrawal:
    """What these entries have not begun to play is off the plan."""

    names: frozenset[str]
    reason: str


@dataclass(frozen=True, slots=True)
class Finish:
    """Nothing is added any more: an entry whose matches have all begun is sent home."""


Message = Addition | Dismissal | Call | Withdrawal | Finish


@dataclass(frozen=True, slots=True)
class Done:
    """The referee has done what it was told."""

    told: Message | None = None
    """Filled in by who told it."""
    withdrawn: Sequence[str] = ()
    """The matches that a withdrawal took off the plan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """What the referee tells between the endings of matches."""

    begun: Sequence[str]
    """Matches that have begun, or were resumed."""
    waiting: frozenset[str]
    """Those remote entries that wait for a match now."""


class RefereeProcess:
    """The process, and the scheduler's end of the pipe; what it prints goes to a log beside the journals."""

    def __init__(self, setting: VenueSetting, address: Address) -> None:
        self._setting, self._address = setting, address
        self._context = multiprocessing.get_context("spawn")
        self._restarts = RestartLimit("the referee", setting.journals / _REFEREE_LOG)
        self._error: ArenaError | None = None
        self._told: deque[Message] = deque()
        """What it has not answered; only the first was sent."""
        self._is_open, self._was_open = False, False

    def __enter__(self) -> "RefereeProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._end()

    def _end(self) -> None:
        """Wait for its end; not for long, for it may hang in what it does last."""
        self._process.join(GOODBYE_S)
        self._process.kill()
        self._process.join()

    def start(self, known: Addition, dismissed: Collection[str], *, is_finished: bool) -> None:
        """Start it with all that it would have been told by now, and wait until the pit is open.

        Raises
        ------
        InputError
            It cannot do what it was told, as listen where another does; unless it could before.
        ArenaError
            It dies, or hangs, again and again.
        """
        self._told = deque(message for message in self._told if isinstance(message, Withdrawal))
        while True:
            self._pipe, theirs = self._context.Pipe()
            self._process = self._context.Process(
                target=_referee,
                args=(theirs, self._address, self._setting, known, frozenset(dismissed), is_finished),
                name="referee",
                daemon=True,
            )
            self._restarts.note_start()
            self._process.start()
            theirs.close()
            try:
                if not self._pipe.poll(OPEN_WITHIN_S):
                    self._process.kill()
                    self.reap(f"it was not ready within {OPEN_WITHIN_S:g} s")
                    continue
                error = self._pipe.recv()
            except (EOFError, OSError):
                self.reap()
            else:
                if error is None:
                    self._is_open = self._was_open = True
                    break
                if isinstance(error, InputError) and not self._was_open:
                    raise error
                self.reap(str(error))
        self._send_next()

    def tell(self, message: Message) -> None:
        """Have it told something, after all that it was told before; `receive` returns when that is done."""
        self._told.append(message)
        if len(self._told) == 1:
            self._send_next()

    def _send_next(self) -> None:
        if self._told and self._is_open:
            try:
                self._pipe.send(self._told[0])
            except OSError:
                return  # it is gone, as `receive` will find

    def receive(self, wait_s: float) -> list[Outcome | News | Done]:
        """Return what it says, once it says something or the time is over.

        Raises
        ------
        EOFError
            It is gone, and everything that it said was heard.
        ArenaError
            It cannot go on, as when its disk is full.
        """
        heard: list[Outcome | News | Done] = []
        if not self._is_open:  # reaped and not started again, as after the last match
            time.sleep(wait_s)
            return heard
        try:
            while self._pipe.poll(0 if heard else wait_s):
                message = self._pipe.recv()
                if isinstance(message, ArenaError):
                    self._error = message
                    break
                if isinstance(message, Done):
                    message = Done(told=self._told.popleft(), withdrawn=message.withdrawn)
                    self._send_next()
                heard.append(message)
        except (EOFError, OSError):  # the latter, where it was killed within a message
            if not heard:
                raise EOFError from None
        if self._error is not None and not heard:
            raise self._error
        return heard

    def reap(self, reason: str = "") -> None:
        """Take note of a referee that is gone; `ArenaError` if that happens again and again."""
        self._is_open = False
        self._end()
        self._pipe.close()
        self._restarts.note_death()
        if self._restarts.is_reached:
            raise ArenaError(self._restarts.failure_message(reason))


def _referee(
    pipe: Connection,
    address: Address,
    setting: VenueSetting,
    known: Addition,
    dismissed: frozenset[str],
    is_finished: bool,
) -> None:
    """Say None once the pit is open, then what happens; an error, if it cannot go on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    follow_parent()
    log = os.open(setting.journals / _REFEREE_LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 1)
    os.dup2(log, 2)
    set_up_logging()
    try:
        warm(setting.ruleset)  # before anybody can ask
        _Service(pipe, address, setting).serve(known, dismissed, is_finished=is_finished)
    except ArenaError as error:
        pipe.send(InputError(str(error)) if isinstance(error, InputError) else ArenaError(str(error)))


class _Service:
    """The referee at its end of the pipe."""

    def __init__(self, pipe: Connection, address: Address, setting: VenueSetting) -> None:
        self._pipe, self._address, self._setting = pipe, address, setting
        self._seating, self._register = PlannedSeating(is_open=True), Register()
        self._remote: set[str] = set()
        self._news = News(begun=(), waiting=frozenset())
        self._resumed: list[str] = []

    def serve(self, known: Addition, dismissed: Collection[str], *, is_finished: bool) -> None:
        """Take up the matches that were begun, and begin the others as those who play them come."""
        setting, address, seating = self._setting, self._address, self._seating
        identity = load_or_make(setting.keys / "pit.key")
        with open_router(address.endpoint, address.pit) as session:
            self._referee = referee = Referee(
                session,
                PitContext(pit=address.pit, identity=identity),
                setting.ruleset,
                seating,
                setting.time_control,
                setting.journals,
                register=self._register,
                on_end=lambda ended: self._pipe.send(_of_match(ended)),
            )
            signal.signal(signal.SIGTERM, lambda *_: referee.stop())
            self._pipe.send(None)  # nobody is answered before `run`
            self._add(known)
            for name in dismissed:
                seating.dismiss(name)
            if is_finished:
                seating.finish()
            try:
                referee.run(self._look)
            finally:
                referee.close()

    def _look(self) -> bool:
        """Do one thing that this referee was told, say what is new, and return whether all is played."""
        if self._pipe.poll():
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                return True  # the scheduler is gone
            self._pipe.send(Done(withdrawn=self._obey(message)))
        begun, self._resumed = [*self._resumed, *self._seating.take_begun()], []
        waiting = frozenset(self._remote & self._seating.waiting) if self._remote else frozenset[str]()
        if begun or waiting != self._news.waiting:
            self._news = News(begun=begun, waiting=waiting)
            self._pipe.send(self._news)
        return self._seating.is_done and self._referee.n_running == 0 and self._referee.is_deserted

    def _obey(self, message: Message) -> Sequence[str]:
        match message:
            case Addition():
                self._add(message)
            case Dismissal():
                self._seating.dismiss(message.name)
            case Call():
                self._seating.call(message.name)
            case Withdrawal():
                return self._seating.drop(message.names)
            case Finish():
                self._seating.finish()
        return ()

    def _add(self, added: Addition) -> None:
        for name, key in added.names.items():
            self._register.claim(name, key)
        self._remote |= added.remote
        resumed = self._referee.resume(dict.fromkeys(plan.identity for plan in added.plans))
        self._resumed += resumed
        self._seating.add([plan for plan in added.plans if plan.identity not in set(resumed)], added.names)


def _of_match(ended: MatchEnded) -> Outcome:
    return Outcome.of(ended.header, ended.result, {team: _of_seat(seat) for team, seat in ended.seats.items()})


def _of_seat(seat: SeatRecord) -> SeatOutcome:
    faults = {kind: n for kind, n in seat.faults().items() if n}
    ordered = sorted(seat.latencies_s)
    if not ordered:
        return SeatOutcome(faults=faults)
    return SeatOutcome(faults=faults, latency_p50_s=ordered[len(ordered) // 2], latency_p99_s=ordered[int(len(ordered) * 0.99)])
