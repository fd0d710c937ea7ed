"""Fighters in processes of their own as a `BatchPolicy`.

A bot file or a program has a process for each match of each seat: it cannot remember one match in another, and its seats think
side by side. A network has one for all seats of its client, since it is large and remembers nothing.
"""

import atexit
import os
import sys
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from threading import TIMEOUT_MAX, Condition

import numpy as np
from numpy.typing import NDArray

from arena.annotations import read_annotations
from arena.bot_calls.current import START, Place
from arena.errors import PolicyError, UnreadableError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, rules_values
from arena.game.types import Action, Team
from arena.jit import cache_root
from arena.policy import BatchPolicy, Faults, MatchResult, Orders, Thinking
from arena.protocol.observation_codec import ObservationWriter
from arena.sandbox.limits import NO_LIMITS, Limits
from arena.sandbox.process import Sandbox
from policies.each_seat import UNREADABLE
from policies.program import PREFIX as PROGRAM
from policies.workers.files import check_readable, resolve
from policies.workers.worker import OutputLog, Worker

LOAD_S = 60.0
"""A fighter that is not loaded by then is taken not to load at all."""


class WorkerFactory:
    """The `BatchFactory` of a fighter in processes of its own.

    Parameters
    ----------
    spec
        What fights, as `policies.registry.load` takes it. The files that a program's command line names by their full path, or
        as they lie here, it finds behind its wall.
    has_wall
        Whether it is a stranger.
    n_spare
        Processes kept ready for matches to come.
    wake
        Called from another thread when a policy that raised `Thinking` may have its answer. Without it, policies wait.
    on_limit
        Called from another thread with what limit a process met.
    patience_s
        How long to wait for an answer, without `wake`; a process that takes longer is ended.
    is_shared
        Whether one process plays all seats; without it, as suits the fighter.
    on_output
        Called from another thread with what processes print, in pieces; without it, that is passed on to stderr.
    most_seats
        Matches at once: each seat may be a process.
    """

    def __init__(
        self,
        spec: str,
        *,
        has_wall: bool = False,
        limits: Limits = NO_LIMITS,
        n_spare: int = 0,
        wake: Callable[[], None] | None = None,
        on_limit: Callable[[str], None] = lambda _: None,
        patience_s: float | None = None,
        is_shared: bool | None = None,
        on_output: Callable[[bytes], None] | None = None,
        most_seats: int = 8,
    ) -> None:
        self.spec, self.wake, self.on_limit, self.most_seats = spec, wake, on_limit, most_seats
        self._command, files = resolve(spec)
        if has_wall:
            check_readable(spec, files)
        self._sandbox = Sandbox(has_wall=has_wall, limits=limits, readable=(*files, cache_root()))
        self._n_spare = n_spare
        self._patience_s = None if patience_s is None else min(patience_s, TIMEOUT_MAX)
        self._log = OutputLog(limits, on_output)
        self._spare: deque[Worker] = deque()
        self._workers: set[Worker] = set()
        self._changed = Condition()
        self._next_seat = 0
        self._is_closed = False
        self.is_shared = not (spec.startswith(PROGRAM) or spec.endswith(".py")) if is_shared is None else is_shared
        atexit.register(self.close)

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> "WorkerPolicy":
        """Return a policy whose seats are played by processes."""
        return WorkerPolicy(ruleset, team, n_seats, self)

    def check(self) -> None:
        """Raise `InputError` if no wall can be built on this machine."""
        self._sandbox.check()

    def prepare(self, patience_s: float = LOAD_S) -> None:
        """Start the processes for the first matches, and return once they have loaded the fighter.

        Raises
        ------
        InputError
            No wall can be built on this machine.
        PolicyError
            The fighter cannot be loaded.
        """
        self.check()
        workers = [self._start() for _ in range(1 if self.is_shared else max(self._n_spare, 1))]
        with self._changed:
            self._changed.wait_for(lambda: all(worker.is_loaded or worker.failure for worker in workers), patience_s)
        for worker in workers:
            if not worker.is_loaded:
                worker.kill(f"it was not ready after {patience_s:g} s")
                raise PolicyError(f"{self.spec} cannot start: {worker.failure}")
        if not self.is_shared:
            self._spare.extend(workers)

    def acquire(self) -> Worker:
        """Return a process for one more match."""
        if self.is_shared:
            self._workers -= {worker for worker in self._workers if worker.failure is not None}
            if self._workers:
                return next(iter(self._workers))
        while self._spare:
            worker = self._spare.popleft()
            if worker.failure is None:
                return worker
            self._workers.discard(worker)
            self._spare.append(self._start())
        return self._start()

    def count_ready(self) -> int:
        """Return how many matches can begin without waiting for a process."""
        if self.is_shared or not self._n_spare:
            return sys.maxsize
        return sum(worker.is_loaded or worker.failure is not None for worker in self._spare)

    def release(self, worker: Worker) -> None:
        """Take a process back whose match is over; returns at once."""
        if not self.is_shared:
            worker.dismiss()
            self._workers.discard(worker)
            if len(self._spare) < self._n_spare:
                self._spare.append(self._start())

    def new_seat(self) -> int:
        """Return a number that no seat of these processes has had."""
        self._next_seat += 1
        return self._next_seat

    def wait(self, workers: Iterable[Worker], are_ready: Callable[[], bool], *, is_loading: bool = False) -> None:
        """Wait until something is so that changes when a process says something; end those that keep us waiting for too long."""
        patience_s = self._patience_s
        if patience_s is not None and is_loading:
            patience_s = max(patience_s, LOAD_S)
        try:
            with self._changed:
                is_so = self._changed.wait_for(are_ready, patience_s)
        except KeyboardInterrupt as error:
            self.explain(error)
            raise
        if not is_so:
            for worker in workers:
                where = " ".join((worker.whereabouts() or "").split())
                stood = f"; {where}" if " line " in where else ""  # of a program, nothing is known
                worker.kill(f"it did not answer within {patience_s:g} s{stood}", counted="late")
            are_ready()

    def memory_bytes(self) -> int | None:
        """Return what all its processes hold in memory; None where the system does not tell."""
        held = [worker.memory_bytes() for worker in self._workers]
        return None if None in held else sum(filter(None, held))

    def explain(self, error: BaseException) -> None:
        """Note on an interrupt where those fighters are that have not answered."""
        for worker in list(self._workers):
            if (where := worker.whereabouts()) is not None:
                error.add_note(where)

    def close(self) -> None:
        """End all processes."""
        atexit.unregister(self.close)
        self._is_closed = True
        for worker in list(self._workers):
            worker.kill()

    def _start(self) -> Worker:
        environment = {"NUMBA_CACHE_DIR": str(cache_root()), "OMP_NUM_THREADS": "1"}  # seats think side by side already
        if not self._sandbox.has_wall:
            environment = {**os.environ, **environment}
        worker = Worker(
            self._command, self._sandbox, environment, log=self._log, on_change=self._on_change, on_limit=self.on_limit
        )  # fmt: skip
        self._workers.add(worker)
        if self._is_closed:  # by another thread, which may not have seen this one
            worker.kill()
        return worker

    def _on_change(self) -> None:
        with self._changed:
            self._changed.notify_all()
        if self.wake is not None:
            self.wake()


@dataclass(slots=True)
class _Row:
    """A seat of one match."""

    worker: Worker
    number: int
    place: Place
    is_begun: bool = False
    """Whether its process was told of the match."""
    is_started: bool = False
    """Whether its process has said that it is ready for it."""
    is_asked: bool = False
    faults: Faults = field(default_factory=Faults)
    annotations: bytes = b""


class WorkerPolicy(BatchPolicy):
    """Seats that processes play. What becomes of a process costs its seats alone: their units stay."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, factory: WorkerFactory) -> None:
        super().__init__(ruleset, team, n_seats)
        self._factory = factory
        self._rows: list[_Row | None] = [None] * n_seats
        self._last_faults = [Faults() for _ in range(n_seats)]
        """Of matches that are over."""
        self._rules = rules_values(ruleset)
        self._places = [Place("", team)] * n_seats
        self._turn_time_s: float | None = None

    def name_match(self, seat: int, match: str) -> None:
        """Hear what the match of `seat` is called."""
        self._places[seat] = Place(match, self.team)

    def set_turn_time(self, seconds: float) -> None:
        """Hear how long a turn may take; each process is told with its next match."""
        self._turn_time_s = seconds

    def start(self, seats: NDArray[np.intp]) -> None:
        """Begin a match for each of `seats`; `Thinking` while one is not ready for it."""
        for seat in np.arange(self.n_seats)[seats].tolist():
            row = self._rows[seat]
            if row is None or row.is_started:
                self._release(seat)
                self._rows[seat] = _Row(self._factory.acquire(), self._factory.new_seat(), self._places[seat])
        rows = [row for row in self._rows if row is not None]
        self._await(rows, self._is_started)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Ask each seat; `Thinking` while one has not answered. A seat that never will gets UNREADABLE."""
        for seat in range(len(observations)):
            row = self._rows[seat]
            if row is not None and not row.is_asked:
                row.is_asked = True
                row.worker.asked = row.place, int(observations.tick[seat])
                row.worker.ask(row.number, ObservationWriter(observations, seat).write())
        self._await([row for row in self._rows if row is not None], lambda row: row.worker.has_answer(row.number))
        for seat in range(len(observations)):
            row = self._rows[seat]
            orders[seat] = Action.STAY if row is None else self._take_orders(row, orders.shape[1], int(observations.tick[seat]))

    def end(self, seat: int, result: MatchResult) -> None:
        """Tell the process how the match ended; returns at once."""
        row = self._rows[seat]
        if row is not None:
            row.worker.finish(row.number, result.to_dict())
            row.faults.add(Faults(counted=row.worker.take_counted()))
            self._last_faults[seat] = row.faults
            self._release(seat)

    def take_faults(self, seat: int) -> Faults:
        """Return what went wrong on `seat` since its match began, and forget it."""
        row = self._rows[seat]
        if row is None:
            faults, self._last_faults[seat] = self._last_faults[seat], Faults()
            return faults
        faults, row.faults = row.faults, Faults()
        return faults

    def take_annotations(self, seat: int) -> bytes:
        """Return what `seat` noted in the last `act`, and forget it; what its process made up is none."""
        row = self._rows[seat]
        if row is None:
            return b""
        taken, row.annotations = row.annotations, b""
        return taken

    def _check_annotations(self, row: _Row, annotations: bytes) -> bytes:
        if not self.keeps_annotations:
            return b""
        try:
            read_annotations(annotations, self.ruleset.side)
        except UnreadableError as error:
            row.faults.note("annotations", f"{error}; its orders count")
            return b""
        return annotations

    def _release(self, seat: int) -> None:
        row, self._rows[seat] = self._rows[seat], None
        if row is not None:
            self._factory.release(row.worker)

    def _is_started(self, row: _Row) -> bool:
        worker = row.worker
        if worker.is_loaded and not row.is_begun:
            row.is_begun = True
            worker.asked = row.place, START
            worker.start(
                row.number, self._rules, int(self.team), row.place.match, turn_time_s=self._turn_time_s,
                keeps_annotations=self.keeps_annotations, explains=self.explains,
            )  # fmt: skip
        if not row.is_started and worker.failure is not None:
            row.is_started = True
        elif not row.is_started and row.is_begun and (answer := worker.take(row.number)) is not None:
            row.is_started = True
            row.faults.add(answer.faults)
        return row.is_started

    def _await(self, rows: list[_Row], is_ready: Callable[[_Row], bool]) -> None:
        def are_ready() -> bool:
            n_ready = sum(map(is_ready, rows))  # all are looked at, since each is to move on by itself
            return n_ready == len(rows)

        if self._factory.wake is None:
            is_loading = any(not row.worker.is_loaded and row.worker.failure is None for row in rows)
            self._factory.wait((row.worker for row in rows if not is_ready(row)), are_ready, is_loading=is_loading)
        elif not are_ready():
            raise Thinking

    def _take_orders(self, row: _Row, n_units: int, tick: int) -> NDArray[np.int8]:
        row.is_asked = False
        answer = row.worker.take(row.number)
        if answer is None:
            row.faults.add(Faults(raised=1, first_traceback=row.worker.failure))
            row.faults.note("process", f"tick {tick}: {row.worker.failure}; all its units stay")
            return np.full(n_units, UNREADABLE, np.int8)
        row.faults.add(answer.faults)
        row.annotations = self._check_annotations(row, answer.annotations)
        given = np.frombuffer(answer.orders, np.int8)
        is_legal = given.shape == (n_units,) and bool(((given >= 0) & (given < len(Action))).all())
        return given if is_legal else np.full(n_units, UNREADABLE, np.int8)
