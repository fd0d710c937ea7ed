"""A worker: a process that referees the matches which the pit hands it, over a session of its own to the pit's router.

It ends when the pit ends, and when it loses the router: another takes its place, and the matches go on from their journals.
"""

import ctypes
import json
import logging
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable
from ctypes import c_longlong
from importlib.metadata import version
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from arena.console import set_up_logging
from arena.errors import ArenaError, LostPitError
from arena.game.engine import warm
from arena.game.types import RULES_VERSION
from arena.local.workers import follow_parent
from arena.network.session import Session, open_client
from arena.pit.effects import Effect, TellPit
from arena.pit.events import ActionReceived, Event, MatchTaken, Ordered, TimePassed, UnfinishedFound
from arena.pit.gate import Gate
from arena.pit.match_loop import MOST_WAITING, MatchLoop
from arena.pit.match_session import PitContext
from arena.pit.workers.left_matches import find_left
from arena.pit.workers.messages import Failed, Gone, Load, Order, Progress, Report, Room, StopWork, TakeMatch, WorkerSettings
from arena.pit.workers.worker_core import WorkerCore
from arena.protocol import topics
from arena.protocol.identity import Identity
from arena.protocol.messages import PROTOCOL_VERSION

logger = logging.getLogger(__name__)

NOBODY = -1
"""In the mark of a worker that is at no match."""
_PROGRESS_S = 1.0
_LISTEN_S = 0.25
"""Between two looks at whether the router is there."""
_MOST_GAP_S = 0.25
"""Between two beats of the pit's router; in a longer one nothing could be heard, and no time passes for the matches."""
_PR_SET_PDEATHSIG = 1


class Pipe(Protocol):
    """What a worker and its pit talk by, as `multiprocessing` has it."""

    def send(self, message: Any, /) -> None:
        """Send a message."""

    def send_bytes(self, message: bytes, /) -> None:
        """Send one that is no Python object."""

    def recv(self) -> Any:
        """Return the next message; `EOFError` when the pit is gone."""

    def poll(self, timeout_s: float, /) -> bool:
        """Return whether a message is there, or comes in time."""


def describe_version() -> bytes:
    """Return what a worker says first: its versions, in a form that no other version changes."""
    versions = {"arena": version("arena-pit"), "protocol": PROTOCOL_VERSION, "rules": RULES_VERSION}
    return json.dumps(versions, sort_keys=True).encode()


def work(pipe: Connection, mark: c_longlong) -> None:
    """Referee until told to stop; the target of the process.

    Parameters
    ----------
    mark
        Memory that the pit reads after this process has died: the lane of the match that it is at, or `NOBODY`.
    """
    os.dup2(2, 1)
    work_for(pipe, lambda session, settings: WorkerLoop(session, settings, pipe, mark))


def work_for(pipe: Pipe, make_loop: Callable[[Session, WorkerSettings], "WorkerLoop"]) -> None:
    """Say the version, take the settings, and referee until told to stop."""
    for number in (signal.SIGINT, signal.SIGTERM):  # which a terminal, or a service manager, sends to all: the pit says when
        signal.signal(number, signal.SIG_IGN)
    _end_with_pit()
    set_up_logging()
    try:
        pipe.send_bytes(describe_version())
        settings = pipe.recv()
    except (EOFError, OSError):
        return
    try:
        warm(settings.ruleset)  # before anybody can ask
        with open_client(settings.endpoint) as session:
            make_loop(session, settings).serve()
    except LostPitError as error:
        logger.warning("worker %d ends: %s", settings.number, error)
    except ArenaError as error:
        pipe.send(Failed(str(error)))


def _end_with_pit() -> None:
    """End this process with the pit's, however that ends; even while this one is stopped, where the kernel can do that."""
    follow_parent()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _end_at_once() -> None:
    """End this process from a thread: its loop may wait for what never comes, and its journals are whole at any time."""
    os.kill(os.getpid(), signal.SIGKILL)


class WorkerLoop(MatchLoop):
    """The matches of this worker."""

    def __init__(
        self, session: Session, settings: WorkerSettings, pipe: Pipe, mark: c_longlong, gate: Gate | None = None
    ) -> None:
        self._pipe, self._mark = pipe, mark
        self._identity = Identity(Ed25519PrivateKey.from_private_bytes(settings.private))
        context = PitContext(
            pit=settings.pit,
            identity=self._identity,
            spectator_key=settings.spectator_key,
            public_delay=settings.public_delay,
        )
        lanes = topics.lanes_of_worker(settings.number)
        self._worker = WorkerCore(context, settings.ruleset, settings.time_control, lanes, self._note_lane)
        self._orders: SimpleQueue[Order] = SimpleQueue()
        self._reports: SimpleQueue[Report | None] = SimpleQueue()
        self._room = Room(0, 0)
        self._told_at_s = 0.0
        self._lost_s, self._heard_at_s = 0.0, time.monotonic()
        super().__init__(
            session,
            settings.pit,
            self._worker,
            session.collect(topics.actions_of_worker(settings.pit, settings.number), MOST_WAITING),
            settings.journals,
            beat=topics.beat_of_worker(settings.pit, settings.number),
            fsync=settings.fsync,
            gate=gate,
            is_delayed_public=settings.public_delay > 0,
            carry_out={TellPit: lambda effect: self._reports.put(effect.report)},
            spare=f"worker-{settings.number}-",
        )

    def serve(self) -> None:
        """Referee until told to stop, and tell the pit all that there is to tell."""
        teller = threading.Thread(target=self._tell, name="teller", daemon=True)
        for thread in (teller, threading.Thread(target=self._listen, name="listener", daemon=True)):
            thread.start()
        try:
            self._refill()
            self._reports.put(self._room)
            self.run(lambda: False)
        finally:
            self.close()
            self._reports.put(None)
            teller.join()

    # Threads: neither the pit nor this loop ever waits for a pipe

    def _tell(self) -> None:
        while (report := self._reports.get()) is not None:
            try:
                self._send(report)
            except OSError:
                _end_at_once()  # the pit is gone

    def _send(self, report: Report) -> None:
        self._pipe.send(report)

    def _hear(self, order: Order) -> None:
        self._orders.put(order)

    def _listen(self) -> None:
        checked_at_s = 0.0
        while True:
            try:
                if self._pipe.poll(_LISTEN_S):
                    self._hear(self._pipe.recv())
            except (EOFError, OSError):
                _end_at_once()  # the pit is gone
            if time.monotonic() - checked_at_s > _LISTEN_S:
                checked_at_s = time.monotonic()
                if not self._has_router():
                    logger.warning("a worker has lost the router, and ends")
                    _end_at_once()

    def _has_router(self) -> bool:
        return self._session.is_connected()

    # The loop

    def _read_clock(self) -> float:
        return time.monotonic() - self._lost_s

    def _note_beat(self) -> None:
        """Take off the clock what passed while the router was not heard: it was the pit's, and is charged to nobody."""
        now_s = time.monotonic()
        gap_s, self._heard_at_s = now_s - self._heard_at_s, now_s
        if gap_s > _MOST_GAP_S:
            self._lost_s += gap_s

    def _sweep(self, now_s: float) -> None:
        self._heard_at_s = time.monotonic()
        for _ in range(self._orders.qsize()):
            self._obey(self._orders.get())
        self._refill()
        self._hand_in(TimePassed(now_s))
        if now_s - self._told_at_s > _PROGRESS_S and self._reports.qsize() == 0:
            self._told_at_s = now_s
            self._reports.put(Progress(self._worker.tell_progress(), _measure()))

    def _hand_in(self, event: Event) -> list[Effect]:
        self._mark.value = event.lane if isinstance(event, ActionReceived | MatchTaken) else NOBODY
        effects = super()._hand_in(event)
        self._mark.value = NOBODY
        return effects

    def _note_lane(self, lane: int) -> None:
        self._mark.value = lane

    def _obey(self, order: Order) -> None:
        if isinstance(order, StopWork):
            self.stop()
        elif isinstance(order, TakeMatch):
            self._take(order)
        else:
            self._hand_in(Ordered(order))

    def _take(self, order: TakeMatch) -> None:
        left = self._find_left(order)
        if isinstance(left, UnfinishedFound):
            self._hand_in(MatchTaken(left, order.new.lane))
        elif left is not None:
            self._worker.n_taken += 1
            for report in left:
                self._reports.put(report)
        else:
            self._spare_journals.refill()
            if len(self._spare_journals):
                self._hand_in(Ordered(order))
            else:
                self._worker.n_taken += 1
                self._reports.put(Gone(order.match, "no journal can be opened"))

    def _find_left(self, order: TakeMatch) -> UnfinishedFound | list[Report] | None:
        return find_left(order, self._journals, self._identity, fsync=self._fsync) if order.is_resumed else None

    def _refill(self) -> None:
        """Tell the pit how many matches can begin, whenever that changes."""
        self._spare_journals.refill()
        room = Room(self._worker.n_taken, len(self._spare_journals))
        if room != self._room:
            self._room = room
            self._reports.put(room)


def _measure() -> Load:
    """Return what this process costs."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    status = Path("/proc/self/statm")
    resident = int(status.read_text().split()[1]) * resource.getpagesize() if status.exists() else used.ru_maxrss * 1024
    return Load(
        processor_s=used.ru_utime + used.ru_stime,
        resident_bytes=resident,
        n_files=len(os.listdir("/dev/fd")),  # noqa: PTH208  # a third of the time of pathlib's
        n_threads=threading.active_count(),
    )
