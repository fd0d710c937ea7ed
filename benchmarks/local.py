"""The local venue: whole matches with their journals written, on all cores."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

from arena.game.keys import secret_from_seed
from arena.game.ruleset import load as load_rules
from arena.local.venue import play
from benchmarks.measuring.rates import RUNS
from policies.registry import load
from tournaments.fixture import plan_fixture

N_PAIRS = 25_000


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Ticks per second of the local venue, `patrol` against `rush`, journals written; starting its processes included."""
    ruleset = load_rules("paper")
    plans = plan_fixture("bench", "patrol", "rush", N_PAIRS, secret_from_seed(0))
    rates, matches = [], []
    with tempfile.TemporaryDirectory() as folder:  # emptied at the end: unlinking would slow the next run down
        for run in range(RUNS + 1):
            progress(f"run {run} of {RUNS}")
            begin = time.perf_counter()
            n_ticks = sum(record.result.ticks for record in play(ruleset, plans, load, journals=Path(folder) / str(run)))
            took_s = time.perf_counter() - begin
            if run:  # the first warms the cache of kernels
                rates.append(n_ticks / took_s)
                matches.append(len(plans) / took_s)
    return {"ticks_per_s": round(median(rates)), "matches_per_s": round(median(matches)), "ticks_per_match": n_ticks / len(plans)}
