"""The processes of a league on the network: its referee, and every entry. Who dies is started anew; all end when the league does.

The referee is told of nothing but the matches that are left, and resumes those whose journal was begun. It ends by itself when
the scheduler is gone, and so does every client: whoever starts the league again starts it with processes of its own.
"""

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from arena.address import Address
from arena.errors import ArenaError, InputError
from arena.games import warm
from arena.keyring.files import load_or_make
from arena.referee.local import MatchPlan
from arena.referee.match import SeatRecord
from arena.referee.register import Register
from arena.referee.seating import PlannedSeating
from arena.referee.service import Played, Referee
from arena.referee.table import House
from arena.referee.workers import follow_parent
from arena.transport import open_router
from tournaments.confine import Confined
from tournaments.outcome import Outcome, SeatOutcome

if TYPE_CHECKING:
    from tournaments.venues import Setting

MOST_DEATHS = 3
"""Times in a row that a process which died young is started anew."""
YOUNG_S = 60.0
"""A process that lived longer was not broken from its start."""
_REFEREE_LOG = "pit.referee.log"  # no name of an entry holds a dot
_POLL_S = 0.2
_PATIENCE_S = 20
_GOODBYE_S = 5


class _Lives:
    """How often a process may still die."""

    def __init__(self, who: str, log: Path) -> None:
        self._who, self._log = who, log
        self._n_deaths, self._born_at_s = 0, 0.0

    def begin(self) -> None:
        """Count from here how long it lives."""
        self._born_at_s = time.monotonic()

    def end(self, last_words: str = "") -> None:
        """Count a death; `ArenaError` if it dies again and again."""
        lived_s = time.monotonic() - self._born_at_s
        self._n_deaths = self._n_deaths + 1 if lived_s < YOUNG_S else 1
        if self._n_deaths > MOST_DEATHS:
            why = f": {last_words}" if last_words else f"; {self._log} says why"
            raise ArenaError(f"{self._who} died {self._n_deaths} times in a row{why}")


class RefereeProcess:
    """The referee of a league in a process of its own, heard over a pipe; what it says goes to a log beside the journals."""

    def __init__(self, setting: "Setting", address: Address, entries: Mapping[str, bytes]) -> None:
        self._setting, self._address, self._entries = setting, address, dict(entries)
        self._context = multiprocessing.get_context("spawn")
        self._lives = _Lives("the referee", setting.journals / _REFEREE_LOG)
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
            self._heard, said = self._context.Pipe(duplex=False)
            self._process = self._context.Process(
                target=_referee,
                args=(said, self._address, self._entries, self._setting, list(plans)),
                name="referee",
                daemon=True,
            )
            self._lives.begin()
            self._process.start()
            said.close()
            try:
                error = self._heard.recv()  # it compiles its kernels first, if need be, and clients would not wait for that
            except (EOFError, OSError):
                self.bury()
            else:
                if error is None:
                    return
                self.bury(str(error))

    def hear(self) -> list[Outcome]:
        """Return the matches that ended meanwhile.

        Raises
        ------
        EOFError
            It is gone, and everything that it said was heard.
        ArenaError
            It cannot go on, as when its disk is full.
        """
        heard: list[Outcome] = []
        try:
            while self._heard.poll(0 if heard else _POLL_S):
                told = self._heard.recv()
                if isinstance(told, ArenaError):
                    self._error = told
                    break
                heard.append(told)
        except (EOFError, OSError):  # the latter, where it was killed within a message
            if not heard:
                raise EOFError from None
        if self._error is not None and not heard:
            raise self._error
        return heard

    def bury(self, last_words: str = "") -> None:
        """Take note of a referee that is gone; `ArenaError` if that happens again and again."""
        self._process.join()
        self._heard.close()
        self._lives.end(last_words)


class ClientProcess:
    """`arena join` as a process; what it says goes to a log beside the journals."""

    def __init__(self, setting: "Setting", address: Address, name: str) -> None:
        self.name = name
        self._log = setting.journals / f"{name}.log"
        self._limits, self._home = setting.limits, setting.homes / name
        self._command = [
            sys.executable,
            "-P",
            "-c",
            "from arena.cli import main; main()",
            "join",
            str(address),
            "--key",
            str(entry_key_path(setting, name).absolute()),  # it starts at home
            "--no-transcripts",
            "--no-audit",
            "--name",
            name,
            "--policy",
            setting.entries[name],
            "--forever",
            "--slots",
            str(setting.slots),
            "--patience",
            str(_PATIENCE_S),
        ]
        self._lives = _Lives(f"the client of {name}", self._log)
        self._start()

    def _start(self) -> None:
        self._lives.begin()
        with self._log.open("ab") as log:
            self._confined = Confined(self._command, self._limits, self._home, log)

    def __enter__(self) -> "ClientProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self._confined.end(_GOODBYE_S)

    def keep_alive(self) -> None:
        """Start the client anew if it died, while it still has matches to play."""
        if self._confined.process.poll() is None:
            return
        self._confined.end(0)
        self._lives.end()
        self._start()


def entry_key_path(setting: "Setting", name: str) -> Path:
    """Return where the key of an entry lives."""
    return setting.keys / "entries" / f"{name}.key"


def _referee(
    said: Connection, address: Address, entries: Mapping[str, bytes], setting: "Setting", plans: list[MatchPlan]
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


def _serve(said: Connection, address: Address, entries: Mapping[str, bytes], setting: "Setting", plans: list[MatchPlan]) -> None:
    """Take up the matches that were begun, and begin the others as those who play them come."""
    ours = {plan.identity for plan in plans}
    warm(setting.ruleset)  # before anybody can ask
    identity = load_or_make(setting.keys / "pit.key")
    with open_router(address.endpoint, address.pit) as session:
        seating = PlannedSeating(plans)
        referee = Referee(
            House(session=session, pit=address.pit, identity=identity),
            setting.ruleset,
            seating,
            setting.terms,
            setting.journals,
            register=Register(names=entries),
            on_end=lambda played: said.send(_of_played(played)),
        )
        signal.signal(signal.SIGTERM, lambda *_: referee.stop())
        seating.withdraw(referee.resume(lambda identity: identity in ours))
        said.send(None)
        try:
            referee.run(lambda: seating.is_done and referee.n_running == 0 and referee.is_deserted)
        finally:
            referee.close()


def _of_played(played: Played) -> Outcome:
    return Outcome.of(played.header, played.result, {team: _of_seat(seat) for team, seat in played.seats.items()})


def _of_seat(seat: SeatRecord) -> SeatOutcome:
    faults = {kind: n for kind, n in seat.faults().items() if n}
    ordered = sorted(seat.latencies_s)
    if not ordered:
        return SeatOutcome(faults=faults)
    return SeatOutcome(faults=faults, latency_p50_s=ordered[len(ordered) // 2], latency_p99_s=ordered[int(len(ordered) * 0.99)])
