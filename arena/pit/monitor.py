"""What an open pit tells a monitor: counted and read by the referee's thread, which is asked for it at most between two sweeps.

So nothing that a turn needs is locked, and a referee that does not answer is not well.
"""

from collections import Counter
from threading import Event

from arena.errors import ArenaError
from arena.metrics.definitions import (
    FAULTS,
    MATCHES_ENDED,
    MATCHES_RUNNING,
    MESSAGES_DROPPED,
    QUEUE,
    REQUESTS_REFUSED,
    STORE_LAG_SECONDS,
    STORE_ROWS_WAITING,
    TICKS,
    TURN_BOUNDS_S,
    TURN_SECONDS,
    WORKER_FILES,
    WORKER_MATCHES,
    WORKER_PROCESSOR_SECONDS,
    WORKER_RESIDENT_BYTES,
    WORKER_RESTARTS,
    WORKER_UP,
    Histogram,
    Reading,
)
from arena.pit.effects import MatchEnded
from arena.pit.ladder import Backlog, Ladder, LaggingLadder
from arena.pit.referee import Referee

PATIENCE_S = 5.0
"""How long the referee may take to answer: five hundred sweeps, and less than a health check waits."""


class PitMonitor:
    """The counts of one pit; `read` is called by one thread, all else by the referee's."""

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self._endings: Counter[str] = Counter()
        self._faults: Counter[str] = Counter()
        self._n_ticks = 0
        self._turns = Histogram(TURN_BOUNDS_S)
        self._is_asked = False
        self._answered = Event()
        self._readings: list[Reading] = []
        self._missing = ""
        """Which worker is being replaced, in a sentence."""

    def read(self) -> list[Reading]:
        """Ask the referee, and return what it answers; `ArenaError` if it does not."""
        self._answered.clear()
        self._is_asked = True
        if not self._answered.wait(self._patience_s):
            raise ArenaError(f"the referee did not answer for {self._patience_s:g} s: it is not open yet, or it hangs")
        return self._readings

    def check_health(self) -> None:
        """Raise `ArenaError` if the referee does not answer, or lacks one of its workers."""
        self.read()
        if self._missing:
            raise ArenaError(self._missing)

    def count(self, ended: MatchEnded) -> None:
        """Count a match that ended."""
        self._endings[ended.result.ending.name.lower()] += 1
        self._n_ticks += ended.result.ticks
        for seat in ended.seats.values():
            self._faults.update(seat.faults())
            self._turns.add(seat.latencies_s)

    def answer(self, referee: Referee, ladder: Ladder | None) -> None:
        """Answer if somebody asks; else do nothing."""
        if not self._is_asked:
            return
        self._is_asked = False
        self._readings = self._take(referee, ladder)
        self._answered.set()

    def _take(self, referee: Referee, ladder: Ladder | None) -> list[Reading]:
        running = referee.running
        faults = Counter(self._faults)
        for match in running:
            faults.update(match.faults())
        backlog = ladder.backlog() if isinstance(ladder, LaggingLadder) else Backlog(0, 0.0)
        return [
            Reading(MATCHES_RUNNING, len(running)),
            Reading(MATCHES_ENDED, dict(self._endings)),
            Reading(TICKS, self._n_ticks + sum(match.tick for match in running)),
            Reading(TURN_SECONDS, self._turns.copy()),
            Reading(FAULTS, dict(faults)),
            Reading(QUEUE, referee.queues),
            Reading(REQUESTS_REFUSED, referee.n_refused),
            Reading(MESSAGES_DROPPED, referee.n_dropped),
            Reading(STORE_ROWS_WAITING, backlog.n_rows),
            Reading(STORE_LAG_SECONDS, backlog.lag_s),
            *self._take_workers(referee),
        ]

    def _take_workers(self, referee: Referee) -> list[Reading]:
        """Return what there is to tell of workers: nothing where this process referees by itself."""
        workers = {str(worker.number): worker for worker in referee.workers}
        n_matches = {name: one.n_running for name, one in workers.items()}
        self._missing = "; ".join(
            f"worker {name} is being replaced; {n_matches[name]} matches wait for it"
            for name, one in workers.items()
            if not one.is_ready
        )
        if not workers:
            return []
        return [
            Reading(WORKER_UP, {name: float(one.is_ready) for name, one in workers.items()}),
            Reading(WORKER_RESTARTS, {name: one.n_restarts for name, one in workers.items()}),
            Reading(WORKER_MATCHES, n_matches),
            Reading(WORKER_PROCESSOR_SECONDS, {name: one.load.processor_s for name, one in workers.items()}),
            Reading(WORKER_RESIDENT_BYTES, {name: one.load.resident_bytes for name, one in workers.items()}),
            Reading(WORKER_FILES, {name: one.load.n_files for name, one in workers.items()}),
        ]
