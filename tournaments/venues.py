"""Where the matches of a league are played. Every venue takes plans and yields outcomes as matches end, in no promised order.

`local` plays in this process and its workers. `network` is the real pit: a referee and every entry a process of its own, Zenoh on
loopback between them.
"""

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from arena.address import Address
from arena.errors import ArenaError
from arena.game.ruleset import Ruleset
from arena.game.types import Ending, Team
from arena.games import warm
from arena.keyring.files import load_or_make
from arena.referee.local import MatchPlan, MatchRecord
from arena.referee.local import play as play_matches
from arena.referee.match import SeatRecord, Terms
from arena.referee.register import Register
from arena.referee.seating import PlannedSeating
from arena.referee.service import Played, Referee
from arena.referee.table import House
from arena.transport import free_port, open_router
from policies.registry import load_entry
from tournaments.confine import NO_LIMITS, Confined, Limits
from tournaments.outcome import Outcome, SeatOutcome

MOST_RESTARTS = 3
"""Times that a process which died is started anew."""
_PIT = "league"
_POLL_S = 0.2
_PATIENCE_S = 20
_GOODBYE_S = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What a venue needs to know of a league."""

    ruleset: Ruleset
    entries: Mapping[str, str]
    """The fighter, by name or file, behind each entry."""
    terms: Terms
    slots: int
    """Seats that the process of an entry holds at once."""
    journals: Path
    keys: Path
    """Folder for the keys of the pit and of the entries: whoever is started anew is still who it was."""
    homes: Path
    """Folder for the homes of the entries' processes."""
    limits: Limits = NO_LIMITS
    """For each process of an entry."""


def play_local(setting: Setting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play in this process and its workers, without a clock."""
    finder = partial(load_entry, dict(setting.entries))
    for record in play_matches(setting.ruleset, plans, finder, journals=setting.journals):
        yield _of_record(record)


def play_network(setting: Setting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play over Zenoh, on loopback.

    Raises
    ------
    ArenaError
        A process died again and again; its log says why.
    """
    if not plans:
        return
    setting.journals.mkdir(parents=True, exist_ok=True)
    names = sorted({name for plan in plans for name in (plan.blue, plan.red)})
    entries = {name: load_or_make(_entry_key(setting, name)).public for name in names}
    pit = load_or_make(setting.keys / "pit.key")
    address = Address(endpoint=f"tcp/127.0.0.1:{free_port()}", pit=_PIT, fingerprint=pit.fingerprint)
    with ExitStack() as processes:
        referee = processes.enter_context(_RefereeProcess(setting, address, entries))
        referee.start(plans)
        clients = [processes.enter_context(_ClientProcess(setting, address, name)) for name in names]
        left = {plan.identity: plan for plan in plans}
        while left:
            for outcome in referee.hear(list(left.values())):
                if outcome.ending is not Ending.VOID and left.pop(outcome.identity, None) is not None:
                    yield outcome
            for client in clients:
                if any(client.name in (plan.blue, plan.red) for plan in left.values()):
                    client.keep_alive()


def _entry_key(setting: Setting, name: str) -> Path:
    return setting.keys / "entries" / f"{name}.key"


VENUES = {"local": play_local, "network": play_network}


class _RefereeProcess:
    """The referee of a league in a process of its own, heard over a pipe."""

    def __init__(self, setting: Setting, address: Address, entries: Mapping[str, bytes]) -> None:
        self._setting, self._address, self._entries = setting, address, dict(entries)
        self._context = multiprocessing.get_context("spawn")
        self._restarts = 0

    def __enter__(self) -> "_RefereeProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.join(_GOODBYE_S)
        self._process.kill()

    def start(self, plans: Sequence[MatchPlan]) -> None:
        """Start, and wait until the pit is open."""
        self._heard, said = self._context.Pipe(duplex=False)
        self._process = self._context.Process(
            target=_referee,
            args=(said, self._address, self._entries, self._setting, list(plans)),
            name="referee",
            daemon=True,
        )
        self._process.start()
        said.close()
        try:
            self._heard.recv()  # it compiles its kernels first, if need be, and clients would not wait for that
        except EOFError:
            self._count_death()
            self.start(plans)

    def hear(self, left: Sequence[MatchPlan]) -> list[Outcome]:
        """Return the matches that ended meanwhile; a referee that died is started anew with what is left."""
        try:
            heard: list[Outcome] = []
            while self._heard.poll(0 if heard else _POLL_S):
                heard.append(self._heard.recv())
            return heard
        except EOFError:
            self._count_death()
            self.start(left)
            return []

    def _count_death(self) -> None:
        self._process.join()
        self._restarts += 1
        if self._restarts > MOST_RESTARTS:
            raise ArenaError(f"the referee died {self._restarts} times, last with exit code {self._process.exitcode}")


class _ClientProcess:
    """`arena join` as a process; what it says goes to a log beside the journals."""

    def __init__(self, setting: Setting, address: Address, name: str) -> None:
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
            str(_entry_key(setting, name)),
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
        self._restarts = 0
        self._start()

    def _start(self) -> None:
        with self._log.open("ab") as log:
            self._confined = Confined(self._command, self._limits, self._home, log)

    def __enter__(self) -> "_ClientProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self._confined.end(_GOODBYE_S)

    def keep_alive(self) -> None:
        """Start the client anew if it died, while it still has matches to play."""
        if self._confined.process.poll() is None:
            return
        self._confined.end(0)
        self._restarts += 1
        if self._restarts > MOST_RESTARTS:
            raise ArenaError(f"the client of {self.name} died {self._restarts} times; see {self._log}")
        self._start()


def _referee(said: Connection, address: Address, entries: Mapping[str, bytes], setting: Setting, plans: list[MatchPlan]) -> None:
    """Referee the plans, resuming those whose journal was begun, and say each outcome."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = os.getppid()
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
            referee.run(lambda: (seating.is_done and referee.n_running == 0 and referee.is_deserted) or os.getppid() != parent)
        finally:
            referee.close()


def _of_record(record: MatchRecord) -> Outcome:
    result, plan = record.result, record.plan
    return Outcome(
        identity=plan.identity,
        blue=plan.blue,
        red=plan.red,
        ending=result.ending,
        winner=result.winner,
        score=result.score,
        ticks=result.ticks,
        reason=result.reason,
        seats={
            team: SeatOutcome(faults={"unreadable": faults.raised + faults.illegal})
            for team, faults in zip(Team, record.faults, strict=True)
        },
    )


def _of_played(played: Played) -> Outcome:
    header, result = played.header, played.result
    return Outcome(
        identity=header.identity,
        blue=header.blue,
        red=header.red,
        ending=result.ending,
        winner=result.winner,
        score=result.score,
        ticks=result.ticks,
        reason=result.reason,
        seats={team: _of_seat(seat) for team, seat in played.seats.items()},
    )


def _of_seat(seat: SeatRecord) -> SeatOutcome:
    ordered = sorted(seat.latencies_s)
    if not ordered:
        return SeatOutcome(faults=seat.faults())
    return SeatOutcome(
        faults=seat.faults(), latency_p50_s=ordered[len(ordered) // 2], latency_p99_s=ordered[int(len(ordered) * 0.99)]
    )
