"""How a rate is measured: five runs, the median, and runs of two things by turns where one is held against the other."""

import time
from collections.abc import Callable, Sequence
from statistics import median
from threading import Barrier, Event, Thread

RUNS = 5
RUN_S = 0.3
Work = Callable[[], int]
"""Does a bit of work, of some milliseconds at most, and returns how much it was."""


def rate(work: Work, run_s: float = RUN_S) -> float:
    """Return the work done per second in one run."""
    done, begin = 0, time.perf_counter()
    while True:
        done += work()
        took_s = time.perf_counter() - begin
        if took_s >= run_s:
            return done / took_s


def median_rate(work: Work, runs: int = RUNS) -> float:
    """Return the median of several runs, after a warm-up."""
    work()
    return median(rate(work) for _ in range(runs))


def paired_rates(one: Work, other: Work, runs: int = RUNS) -> tuple[float, float, float]:
    """Return the median rates of two works that run by turns, and the median of their ratios, pair by pair."""
    one(), other()
    pairs = [(rate(one), rate(other)) for _ in range(runs)]
    return median(a for a, _ in pairs), median(b for _, b in pairs), median(a / b for a, b in pairs)


def threaded_rate(works: Sequence[Work], run_s: float = RUN_S) -> float:
    """Return the sum of the rates of works that run at once, a thread each; each runs at least once, however busy the machine."""
    done = [0] * len(works)
    barrier, stop = Barrier(len(works) + 1), Event()

    def run(index: int) -> None:
        barrier.wait()
        while True:
            done[index] += works[index]()
            if stop.is_set():
                return

    threads = [Thread(target=run, args=(index,)) for index in range(len(works))]
    for thread in threads:
        thread.start()
    barrier.wait()
    begin = time.perf_counter()
    stop.wait(run_s)
    stop.set()
    for thread in threads:
        thread.join()
    return sum(done) / (time.perf_counter() - begin)
