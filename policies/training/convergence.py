"""Whether a run has converged: the slope of its score over its newest half, with a 95% interval.

A mean over some matches that hardly differs from that over the matches before tells little: a match is worth 0 or 100 points, so
that such a difference has a standard error of points itself. Here a run has converged only where its interval of the slope
contains zero and is narrow as well. Where it is wide, nothing can be told, and a longer run can.

What is left out, and why: a score that wanders for longer than a twentieth of the run and comes back cannot be told from one that
rises or falls for good, by this or any rule that knows one run.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

PER_MATCHES = 10_000
"""Matches that a slope is given for."""
NARROW = 2.0
"""Points per `PER_MATCHES` that both ends of a converged run's interval keep within."""
_BLOCKS = 20
_LEAST_ROUNDS = 2 * _BLOCKS
_MOST_CORRELATED = 0.9

Line = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Matches played up to each round, and its score; each shape (rounds,)."""


class Verdict(StrEnum):
    """What can be said of a run's end."""

    CONVERGED = "converged"
    RISES = "rises"
    FALLS = "falls"
    UNKNOWN = "cannot be told"


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """A slope in points per `PER_MATCHES` matches, and its 95% interval; None where there are too few rounds for any."""

    slope: float | None
    low: float | None
    high: float | None
    verdict: Verdict


def judge(lines: Sequence[Line]) -> Trend:
    """Return how the mean of some runs, of one or more seeds, moves over the newest half of what all of them have played.

    Notes
    -----
    A line by least squares through 20 means of equally many matches. What correlation is left between neighbouring means widens
    the interval, as if there were fewer of them. On noise that is correlated over 500 matches, intervals over 10,000 matches
    hold the true slope in 93% of cases.
    """
    end = min(float(episodes[-1]) for episodes, _ in lines)
    edges = np.linspace(end / 2, end, _BLOCKS + 1)
    blocks = [_block_means(line, edges) for line in lines]
    known = [one for one in blocks if one is not None]
    if len(known) < len(blocks):
        return Trend(slope=None, low=None, high=None, verdict=Verdict.UNKNOWN)
    middle = (edges[1:] + edges[:-1]) / 2 / PER_MATCHES
    slope, reach = _fit(middle - middle.mean(), np.mean(known, axis=0))
    slope, low, high = (round(one, 2) + 0.0 for one in (slope, slope - reach, slope + reach))  # as shown, and no -0.0
    if low > 0 or high < 0:
        verdict = Verdict.RISES if low > 0 else Verdict.FALLS
    else:
        verdict = Verdict.CONVERGED if max(-low, high) <= NARROW else Verdict.UNKNOWN
    return Trend(slope=slope, low=low, high=high, verdict=verdict)


def _block_means(line: Line, edges: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the mean score between edges, shape (blocks,), or None where there are too few rounds."""
    episodes, score = line
    block = np.searchsorted(edges, episodes) - 1
    rows = (block >= 0) & (block < _BLOCKS)
    counts = np.bincount(block[rows], minlength=_BLOCKS)
    if rows.sum() < _LEAST_ROUNDS or not counts.all():
        return None
    return np.bincount(block[rows], score[rows], minlength=_BLOCKS) / counts


def _fit(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Return the slope of a line, and what its 95% interval reaches to either side; the mean of `x` is 0."""
    n = len(x)
    slope = float(x @ y / (x @ x))
    rest = y - y.mean() - slope * x
    square = float(rest @ rest)
    if square < 1e-12:
        return slope, 0.0
    correlation = float(rest[1:] @ rest[:-1]) / square
    # What is left of a line has a correlation too low by some (2 + 4 r) / n.
    correlation = min(max(correlation + (2 + 4 * correlation) / n, 0.0), _MOST_CORRELATED)
    inflation = (1 + correlation) / (1 - correlation)
    error = np.sqrt(square / (n - 2) / (x @ x) * inflation)
    return slope, float(student_t.ppf(0.975, max(n / inflation - 2, 2)) * error)
