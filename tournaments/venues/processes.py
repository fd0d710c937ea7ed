"""The processes of a league on the network: its referee, and every entry. Who dies is started anew; all end when the league does.

The referee is told of nothing but the matches that are left, and resumes those whose journal was begun. It ends by itself when
the scheduler is gone, and so does every client: whoever starts the league again starts it with processes of its own.
"""

import logging
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from arena.errors import ArenaError, InputError
from arena.folders import data_folder
from arena.game.engine import warm
from arena.jit import cache_root
from arena.keyring.files import load_or_make
from arena.local.workers import follow_parent
from arena.match.match import SeatRecord
from arena.network.address import Address
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.register import Register
from arena.pit.seating import PlannedSeating
from arena.records.plan import MatchPlan
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox, SandboxedProcess
from policies.workers.files import resolve
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.setting import VenueSetting

MOST_DEATHS = 3
"""Times in a row that a process which died young is started anew."""
YOUNG_S = 60.0
"""A process that lived longer was not broken from its start."""
_REFEREE_LOG = "pit.referee.log"  # no name of an entry holds a dot
_POLL_S = 0.2
_PATIENCE_S = 20
_GOODBYE_S = 5
HUNG_S = 30.0
"""A client that gave no sign of life for so long is started anew."""
logger = logging.getLogger(__name__)


class _RestartLimit:
    """Counts how often a process died young, and says when it is to be started no more."""

    def __init__(self, who: str, log: Path) -> None:
        self._who, self._log = who, log
        self._n_deaths, self._born_at_s = 0, 0.0

    def note_start(self) -> None:
        """Count from here how long it lives."""
        self._born_at_s = time.monotonic()

    def note_death(self) -> None:
        """Count a death."""
        lived_s = time.monotonic() - self._born_at_s
        self._n_deaths = self._n_deaths + 1 if lived_s < YOUNG_S else 1

    @property
    def is_reached(self) -> bool:
        """Whether it died too often."""
        return self._n_deaths > MOST_DEATHS

    def failure_message(self, reason: str = "") -> str:
        """Return how it died, in one sentence."""
        why = f": {reason}" if reason else f"; {self._log} says why"
        return f"{self._who} died {self._n_deaths} times in a row{why}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Absence:
    """Since when a client is kept away."""

    n_left: int
    """Matches that it had to play then."""
    give_up_at_s: float
    """By then the referee has ruled, if there is anything to rule on."""


_TRUSTED = Sandbox(has_wall=False, limits=NO_LIMITS)


class RefereeProcess:
    """The referee of a league in a process of its own, heard over a pipe; what it says goes to a log beside the journals."""

    def __init__(self, setting: VenueSetting, address: Address, entries: Mapping[str, bytes]) -> None:
        self._setting, self._address, self._entries = setting, address, dict(entries)
        self._context = multiprocessing.get_context("spawn")
        self._restarts = _RestartLimit("the referee", setting.journals / _REFEREE_LOG)
        self._error: ArenaError | None = None

    def __enter__(self) -> "RefereeProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.join(_GOODBYE_S)
        self._process.kill()

    def start(self, plans: Sequence[MatchPlan]) -> None:
        """Start with matches to be played, and wait until the pit is open."""
        while True:
            self._pipe, said = self._context.Pipe(duplex=False)
            self._process = self._context.Process(
                target=_referee,
                args=(said, self._address, self._entries, self._setting, list(plans)),
                name="referee",
                daemon=True,
            )
            self._restarts.note_start()
            self._process.start()
            said.close()
            try:
                error = self._pipe.recv()  # it compiles its kernels first, if need be, and clients would not wait for that
            except (EOFError, OSError):
                self.reap()
            else:
                if error is None:
                    return
                self.reap(str(error))

    def receive(self) -> list[Outcome]:
        """Return the matches that ended meanwhile.

        Raises
        ------
        EOFError
            It is gone, and everything that it said was heard.
        ArenaError
            It cannot go on, as when its disk is full.
        """
        ended: list[Outcome] = []
        try:
            while self._pipe.poll(0 if ended else _POLL_S):
                message = self._pipe.recv()
                if isinstance(message, ArenaError):
                    self._error = message
                    break
                ended.append(message)
        except (EOFError, OSError):  # the latter, where it was killed within a message
            if not ended:
                raise EOFError from None
        if self._error is not None and not ended:
            raise self._error
        return ended

    def reap(self, reason: str = "") -> None:
        """Take note of a referee that is gone; `ArenaError` if that happens again and again."""
        self._process.join()
        self._pipe.close()
        self._restarts.note_death()
        if self._restarts.is_reached:
            raise ArenaError(self._restarts.failure_message(reason))


class ClientProcess:
    """`arena join` as a process; what it says goes to a log beside the journals."""

    def __init__(self, setting: VenueSetting, address: Address, name: str) -> None:
        self.name = name
        self._log = setting.journals / f"{name}.log"
        self._home = (setting.homes / name).absolute()
        self._notes, self._alive = self._home / "notes", self._home / "alive"
        sandbox = setting.sandboxes.get(name, _TRUSTED)
        self._command = [
            sys.executable,
            "-P",
            "-c",
            "from tournaments.cli import main; main()",
            "join",
            str(address),
            "--key",
            str(entry_key_path(setting, name).absolute()),
            "--no-transcripts",
            "--no-audit",
            "--name",
            name,
            "--policy",
            resolve(setting.entries[name])[0],  # it starts at home
            "--forever",
            "--slots",
            str(setting.slots),
            "--patience",
            str(_PATIENCE_S),
            "--sandbox" if sandbox.has_wall else "--no-sandbox",
            "--notes",
            str(self._notes),
            "--alive",
            str(self._alive),
            *(f"--limit={assignment}" for assignment in sandbox.limits.assignments()),
        ]
        self._restarts = _RestartLimit(f"the client of {name}", self._log)
        self._grace_s = setting.time_control.grace_s
        self._away: _Absence | None = None
        data_folder(self._home, 0o700)
        self._notes.unlink(missing_ok=True)
        self._n_noted = 0
        self._start()

    def _start(self) -> None:
        self._away = None
        self._restarts.note_start()
        self._alive.unlink(missing_ok=True)
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "ARENA_CONFIG"))}
        environment |= {"HOME": str(self._home), "NUMBA_CACHE_DIR": str(cache_root())}
        with self._log.open("ab") as log:
            self._started = SandboxedProcess(self._command, _TRUSTED, environment, cwd=self._home, log=log)

    def __enter__(self) -> "ClientProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self._started.process.terminate()
        self._started.end(_GOODBYE_S)

    def take_limits_met(self) -> Counter[str]:
        """Return how often the fighter met each of its limits since the last call."""
        try:
            lines = self._notes.read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            return Counter()
        new, self._n_noted = lines[self._n_noted :], len(lines)
        return Counter(f"{line} limit" for line in new)

    def _hangs(self) -> bool:
        """Whether the process is there, and does nothing: it leaves a sign of life several times a second."""
        try:
            seen_at_s = self._alive.stat().st_mtime
        except FileNotFoundError:
            return False  # it still starts, or dies, which is seen elsewhere
        if time.time() - seen_at_s <= HUNG_S:
            return False
        logger.warning("the client of %s gave no sign of life for %g s; it is started anew", self.name, HUNG_S)
        return True

    def keep_alive(self, n_left: int) -> None:
        """Start the client anew if it died or hangs, while it still has matches to play.

        One that dies again and again stays away until the referee has ruled that it forfeits what it was in the middle of: a bot
        that cannot live through a match loses it, and ends nobody's league.

        Parameters
        ----------
        n_left
            Matches that it still has to play.

        Raises
        ------
        ArenaError
            It died again and again, and no match was there to be ruled on: it does not come as far as that.
        """
        if n_left == 0 or (self._away is None and self._started.process.poll() is None and not self._hangs()):
            return
        if self._away is None:
            self._started.end(0)
            self._restarts.note_death()
            if self._restarts.is_reached:
                logger.warning("%s; what it is in the middle of is forfeited", self._restarts.failure_message())
                self._away = _Absence(n_left=n_left, give_up_at_s=time.monotonic() + self._grace_s + _PATIENCE_S)
                return
        elif n_left == self._away.n_left:
            if time.monotonic() > self._away.give_up_at_s:
                raise ArenaError(self._restarts.failure_message())
            return
        self._start()


def entry_key_path(setting: VenueSetting, name: str) -> Path:
    """Return where the key of an entry lives."""
    return setting.keys / "entries" / f"{name}.key"


def _referee(
    said: Connection, address: Address, entries: Mapping[str, bytes], setting: VenueSetting, plans: list[MatchPlan]
) -> None:
    """Referee the plans, and say None once the pit is open, then each outcome; an error, if it cannot go on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    follow_parent()
    log = os.open(setting.journals / _REFEREE_LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 1)
    os.dup2(log, 2)
    try:
        _serve(said, address, entries, setting, plans)
    except ArenaError as error:
        said.send(InputError(str(error)) if isinstance(error, InputError) else ArenaError(str(error)))


def _serve(
    said: Connection, address: Address, entries: Mapping[str, bytes], setting: VenueSetting, plans: list[MatchPlan]
) -> None:
    """Take up the matches that were begun, and begin the others as those who play them come."""
    ours = {plan.identity for plan in plans}
    warm(setting.ruleset)  # before anybody can ask
    identity = load_or_make(setting.keys / "pit.key")
    with open_router(address.endpoint, address.pit) as session:
        seating = PlannedSeating(plans)
        referee = Referee(
            session,
            PitContext(pit=address.pit, identity=identity),
            setting.ruleset,
            seating,
            setting.time_control,
            setting.journals,
            register=Register(names=entries),
            on_end=lambda ended: said.send(_of_match(ended)),
        )
        signal.signal(signal.SIGTERM, lambda *_: referee.stop())
        seating.withdraw(referee.resume(lambda identity: identity in ours))
        said.send(None)
        try:
            referee.run(lambda: seating.is_done and referee.n_running == 0 and referee.is_deserted)
        finally:
            referee.close()


def _of_match(ended: MatchEnded) -> Outcome:
    return Outcome.of(ended.header, ended.result, {team: _of_seat(seat) for team, seat in ended.seats.items()})


def _of_seat(seat: SeatRecord) -> SeatOutcome:
    faults = {kind: n for kind, n in seat.faults().items() if n}
    ordered = sorted(seat.latencies_s)
    if not ordered:
        return SeatOutcome(faults=faults)
    return SeatOutcome(faults=faults, latency_p50_s=ordered[len(ordered) // 2], latency_p99_s=ordered[int(len(ordered) * 0.99)])
