"""Every metric, once: the pit, the season, the web page and clients tell of those that they have."""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """One metric, as Prometheus knows it."""

    name: str
    """Of a counter, without the `_total` that its samples end with."""
    kind: Literal["gauge", "counter", "histogram"]
    help: str
    label: str = ""
    """What its samples are told apart by; nothing where there is one sample."""


MATCHES_RUNNING = Metric(name="arena_matches_running", kind="gauge", help="Matches that are not over.")
MATCHES_ENDED = Metric(name="arena_matches_ended", kind="counter", help="Matches that ended.", label="ending")
TICKS = Metric(name="arena_ticks", kind="counter", help="Ticks played.")
TURN_SECONDS = Metric(
    name="arena_turn_seconds", kind="histogram", help="What answered turns were charged, once their match is over."
)
FAULTS = Metric(name="arena_faults", kind="counter", help="Late orders, and what else is counted of seats.", label="fault")
QUEUE = Metric(name="arena_queue_length", kind="gauge", help="How many wait for their turn.", label="queue")
REQUESTS_REFUSED = Metric(
    name="arena_requests_refused", kind="counter", help="Requests that did not open, or that somebody else had signed."
)
MESSAGES_DROPPED = Metric(name="arena_messages_dropped", kind="counter", help="Messages dropped since their queue was full.")
STORE_ROWS_WAITING = Metric(name="arena_store_rows_waiting", kind="gauge", help="Results that are not stored yet.")
STORE_LAG_SECONDS = Metric(name="arena_store_lag_seconds", kind="gauge", help="How long the oldest of those has waited.")
WORKER_UP = Metric(name="arena_worker_up", kind="gauge", help="1 if a worker takes matches, else 0.", label="worker")
WORKER_RESTARTS = Metric(
    name="arena_worker_restarts", kind="counter", help="Times that a worker ended and was replaced.", label="worker"
)
WORKER_MATCHES = Metric(
    name="arena_worker_matches_running", kind="gauge", help="Matches of a worker that are not over.", label="worker"
)
WORKER_PROCESSOR_SECONDS = Metric(
    name="arena_worker_processor_seconds", kind="counter", help="What a worker has spent of the processor.", label="worker"
)
WORKER_RESIDENT_BYTES = Metric(name="arena_worker_resident_bytes", kind="gauge", help="The memory of a worker.", label="worker")
WORKER_FILES = Metric(name="arena_worker_open_files", kind="gauge", help="Files that a worker has open.", label="worker")
STORE_SECONDS = Metric(
    name="arena_store_seconds", kind="histogram", help="How long transactions of the store took, waiting included."
)
STORE_FAILURES = Metric(
    name="arena_store_failures", kind="counter", help="Transactions that failed, those that were tried again too."
)
SEAT_P99_SECONDS = Metric(
    name="arena_seat_p99_seconds",
    kind="histogram",
    help="For each seat of each match, once it is over, the 99th percentile of its turns.",
)
THINK_SECONDS = Metric(name="arena_think_seconds", kind="histogram", help="How long the policy thought, once its match is over.")
PIT_REACHABLE = Metric(name="arena_pit_reachable", kind="gauge", help="1 if the pit answers the web page or the client, else 0.")
PAGES_OPEN = Metric(name="arena_pages_open", kind="gauge", help="Pages that stay connected to watch or to play.")
PAGE_SECONDS = Metric(name="arena_page_seconds", kind="histogram", help="How long the web server took to answer.")
METRICS = tuple(value for value in list(globals().values()) if isinstance(value, Metric))


TURN_BOUNDS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)
"""Of histograms of turns, and of what takes as long."""


@dataclass(slots=True)
class Histogram:
    """How many values fell below each of some bounds; one thread adds to it."""

    bounds: Sequence[float]
    counts: list[int] = field(default_factory=list)
    """Values up to each bound and above the one before; the last, those above all."""
    total: float = 0.0

    def __post_init__(self) -> None:
        self.counts = list(self.counts) or [0] * (len(self.bounds) + 1)

    def add(self, values: Iterable[float]) -> None:
        """Count some values."""
        for value in values:
            self.counts[bisect_left(self.bounds, value)] += 1
            self.total += value

    def copy(self) -> "Histogram":
        """Return what was counted so far, for another thread."""
        return Histogram(self.bounds, self.counts, self.total)


@dataclass(frozen=True, slots=True)
class Reading:
    """What a metric reads now."""

    metric: Metric
    values: float | Histogram | Mapping[str, float]
    """A mapping where the metric has a label: by its values."""
