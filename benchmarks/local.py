"""The local venue: whole matches with their journals written, on all cores, beside the bare kernel of the same run."""

import os
import resource
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from arena.game.keys import secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.local.venue import ROWS, play
from arena.records.plan import MatchPlan
from benchmarks.kernel import make_work
from benchmarks.measuring.rates import RUNS, Work
from policies.registry import load
from tournaments.fixture import plan_fixture

N_PAIRS = 25_000
_KERNEL_CALLS = 100
_PAIRS_AT_START = 32
"""Of so few, nearly all the time goes to starting the processes."""


class _Cost(NamedTuple):
    n_ticks: int
    wall_s: float
    processor_s: float


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Ticks per second of the local venue, `patrol` against `rush`, journals written.

    Starting its processes is part of `ticks_per_s`, and none of `once_started`. On a machine that is busy elsewhere, read the
    processor time: `ticks_per_core_s` and `us_per_match`, both without the starting. `over_kernel` is the first of them over that
    of the bare kernel, which steps and observes alone, on as many threads, measured by turns.
    """
    ruleset = load_rules("paper")
    plans = plan_fixture("bench", "patrol", "rush", N_PAIRS, secret_from_seed(0))
    n_cores = len(os.sched_getaffinity(0))
    work = [make_work("paper", ROWS, seed) for seed in range(n_cores)]
    found: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as folder:  # emptied at the end: unlinking would slow the next run down
        for number in range(RUNS + 1):
            progress(f"run {number} of {RUNS}")
            kernel = _kernel_ticks_per_core_s(work)
            few, whole = (
                _play(ruleset, some, Path(folder) / f"{number}-{len(some)}") for some in (plans[: 2 * _PAIRS_AT_START], plans)
            )
            n_ticks, n_matches = whole.n_ticks - few.n_ticks, len(plans) - 2 * _PAIRS_AT_START
            processor_s = whole.processor_s - few.processor_s
            found.append(
                {
                    "ticks_per_s": whole.n_ticks / whole.wall_s,
                    "matches_per_s": len(plans) / whole.wall_s,
                    "once_started": n_ticks / max(whole.wall_s - few.wall_s, 1e-6),
                    "ticks_per_core_s": n_ticks / processor_s,
                    "us_per_match": processor_s / n_matches * 1e6,
                    "kernel_ticks_per_core_s": kernel,
                    "over_kernel": n_ticks / processor_s / kernel,
                    "start_s": few.wall_s,
                    "start_core_s": few.processor_s,
                }
            )
    found = found[1:]  # the first warms the cache of kernels
    figures = {name: median(one[name] for one in found) for name in found[0]}
    return {name: round(figure, 3 if figure < 100 else None) for name, figure in figures.items()} | {
        "cores": n_cores,
        "ticks_per_match": whole.n_ticks / len(plans),
    }


def _kernel_ticks_per_core_s(works: Sequence[Work]) -> float:
    before = _processor_s()
    with ThreadPoolExecutor(len(works)) as pool:
        n_ticks = sum(pool.map(lambda work: sum(work() for _ in range(_KERNEL_CALLS)), works))
    return n_ticks / (_processor_s() - before)


def _play(ruleset: Ruleset, plans: Sequence[MatchPlan], journals: Path) -> _Cost:
    begin, before = time.perf_counter(), _processor_s()
    n_ticks = sum(record.result.ticks for record in play(ruleset, plans, load, journals=journals))
    return _Cost(n_ticks, time.perf_counter() - begin, _processor_s() - before)


def _processor_s() -> float:
    """Return what this process and those that it started and ended have taken."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in spent)
