"""The fighters: what a seat and tick of each costs, in nanoseconds, on observations of real games.

Alone, they are told how long a turn may take, as in a pit, and the share of turns that take longer is given as `late`.
"""

from collections.abc import Callable
from functools import partial
from statistics import median, quantiles
from typing import Any

import numpy as np

from benchmarks.measuring.rates import RUNS
from benchmarks.measuring.turns import time_turns
from policies.registry import load, names

MOST_SEATS = 1024
"""In a batch; fewer where fewer suit a fighter."""
TURN_TIME_S = 0.1
_TICKS, _TICKS_ALONE = 60, 2000
_ENEMY = "random"
_MOST_S = 5.0
"""Of thinking, in one run."""


def run(progress: Callable[[str], None], turn_time: float = TURN_TIME_S) -> dict[str, Any]:
    """Nanoseconds per seat and tick of each fighter, in a batch and alone, and which share of its turns is late."""
    results: dict[str, Any] = {}
    for name in names():
        progress(name)
        make = load(name)
        batch = min(getattr(make, "most_seats", MOST_SEATS), MOST_SEATS)
        together = _repeat(partial(time_turns, make, load(_ENEMY), batch, _TICKS, _MOST_S))
        alone = _repeat(partial(time_turns, make, load(_ENEMY), 1, _TICKS_ALONE, _MOST_S, turn_time_s=turn_time))
        taken_s = np.concatenate(alone) / 1e9
        results[name] = {
            f"batch_{batch}_ns": round(median(map(median, together)) / batch),
            "batch_1_ns": round(median(map(median, alone))),
            "batch_1_p99_ns": round(median(quantiles(run, n=100)[98] for run in alone)),
            "late": round(float(np.mean(taken_s > turn_time)), 5),
        }
    return results


def _repeat(time: Callable[[], list[int]]) -> list[list[int]]:
    """Return what several runs give, after one to warm up."""
    return [time() for _ in range(RUNS + 1)][1:]
