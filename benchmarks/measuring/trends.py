"""Whether something grows: the slope of a series over time, with its interval, pooled over the lives of processes."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

WARM_UP_S = 120.0
"""Of each life: so long, caches fill."""
_LEAST = 10
"""Samples, without which a slope says nothing."""
_JUDGED_MIN = 5.0
"""Of measurement, from which on it is judged whether something grows."""
MOST_GROWTH = {"memory_kb": 500.0, "handles": 0.5, "threads": 0.2}
"""A minute, of one process, beside what it is to remember."""


@dataclass(frozen=True, slots=True)
class Slope:
    """How fast something grows, a minute."""

    per_min: float
    low: float
    high: float
    """Of an interval of 95%."""
    minutes: float
    """Over which it was measured, all lives together, their warm-up apart."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a process holds."""

    memory_kb: int
    """Of its own: its anonymous pages."""
    handles: int
    threads: int


def read_cost(pid: int) -> Cost | None:
    """Return what a process holds; None if it has ended, or is not ours to look at."""
    folder = Path("/proc") / str(pid)
    try:
        status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
        handles = len(list((folder / "fd").iterdir()))
        return Cost(int(status["RssAnon"].split()[0]), handles, int(status["Threads"]))
    except (OSError, KeyError):  # a process that has ended, and is not reaped, has no memory
        return None


@dataclass(slots=True)
class Lives:
    """Series of one kind of process: for each life, when it was looked at and what was found."""

    series: dict[int, list[tuple[float, float]]] = field(default_factory=lambda: defaultdict(list))

    def add(self, life: int, at_s: float, value: float) -> None:
        """Add what was found of a life."""
        self.series[life].append((at_s, value))

    def slope(self, warm_up_s: float = WARM_UP_S) -> Slope | None:
        """Return how fast it grows within a life; None if too little was seen.

        Least squares, each life with a level of its own. Neighbouring samples are alike, so they count for fewer: as many as
        their correlation leaves (Santer et al. 2000, J. Geophys. Res. 105:7337).
        """
        minutes: list[float] = []
        values: list[float] = []
        total, n_lives = 0.0, 0
        for samples in self.series.values():
            kept = np.array([sample for sample in samples if sample[0] - samples[0][0] >= warm_up_s])
            if len(kept) < 3:
                continue
            at_min, found = kept[:, 0] / 60, kept[:, 1]
            total, n_lives = total + float(at_min[-1] - at_min[0]), n_lives + 1
            minutes += list(at_min - at_min.mean())
            values += list(found - found.mean())
        if len(minutes) < _LEAST:
            return None
        x, y = np.array(minutes), np.array(values)
        per_min = float(x @ y / (x @ x))
        left = y - per_min * x
        product, square = float(left[1:] @ left[:-1]), float(left @ left)
        alike = min(max(product / square, 0.0), 0.99) if square else 0.0
        n_free = max(len(x) * (1 - alike) / (1 + alike) - n_lives - 1, 1.0)
        error = math.sqrt(square / n_free / float(x @ x))
        half = float(stats.t.ppf(0.975, n_free)) * error
        return Slope(per_min, per_min - half, per_min + half, total)


class Growth:
    """What processes hold over time, by what they do."""

    def __init__(self) -> None:
        self._lives: dict[str, dict[str, Lives]] = defaultdict(lambda: defaultdict(Lives))

    def look(self, roles: Mapping[str, Sequence[int]], now_s: float) -> None:
        """Look at what processes hold, by the name of what they do."""
        for role, pids in roles.items():
            for pid in pids:
                cost = read_cost(pid)
                if cost is not None:
                    for what in MOST_GROWTH:
                        self._lives[role][what].add(pid, now_s, float(getattr(cost, what)))

    def judge(self, remembered_kb: Mapping[str, float]) -> tuple[dict[str, Any], list[str]]:
        """Return how fast each grows, and in sentences what grows too fast.

        Parameters
        ----------
        remembered_kb
            By how much the memory of some is to grow in a minute, by the name of what they do: no more of it is too fast.
        """
        figures: dict[str, Any] = {}
        broken = []
        for role, found in self._lives.items():
            for what, most in MOST_GROWTH.items():
                slope = found[what].slope()
                if slope is None:
                    figures.setdefault(role, {})[what] = "too short to tell"
                    continue
                figures.setdefault(role, {})[what] = {
                    "slope": round(slope.per_min, 3), "low": round(slope.low, 3), "high": round(slope.high, 3)
                }  # fmt: skip
                figures[role]["minutes"] = round(slope.minutes, 1)
                if what == "memory_kb":
                    most += remembered_kb.get(role, 0.0)
                if slope.minutes >= _JUDGED_MIN and slope.low > most:
                    broken.append(f"the {what} of each {role} grow by at least {slope.low:.1f} a minute")
        return figures, broken
