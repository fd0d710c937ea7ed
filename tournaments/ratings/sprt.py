"""Is one entry better than another? The pentanomial sequential test answers in as few pairs as it takes.

A pair brings one of five scores, 0 to 2 in halves, so the luck of a map that favours a side cancels within it. The test weighs
two claims about the expected score of a match, `H0: expected_score(elo0)` and `H1: expected_score(elo1)`, by the generalised log
likelihood ratio: each claim is given the likeliest distribution of the five scores that has the claimed mean,

    p[k] = seen[k] / (1 + t * (score[k] - mean)),   with t such that  sum(p[k] * (score[k] - mean)) = 0

    llr = sum(n[k] * log(p1[k] / p0[k]))

and goes on while `log(beta / (1 - alpha)) < llr < log((1 - beta) / alpha)` (Wald, Sequential Analysis, 1947).

Notes
-----
Source: M. Van den Bergh, "The generalized maximum likelihood ratio for the expectation value of a distribution", Proposition 1.1
(cantate.be/Fishtest/support_MLE_multinomial.pdf), as fishtest tests Stockfish with. X. Li, J. Liu and Z. Ying, "Generalized
sequential probability ratio test for separate families of hypotheses", 2014, for why such a test takes the fewest pairs.

The shortcut with the sample variance, `n * (s1 - s0) * (2 * s - s0 - s1) / (2 * variance)`, was left out: it decides after two
pairs that went alike, as their variance is 0, where the likelihood of bounded scores stays modest.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import exp, expm1, log

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome

PAIR_SCORES = (0.0, 0.5, 1.0, 1.5, 2.0)
_MATCH_SCORES = np.array(PAIR_SCORES) / 2
_UNSEEN = 1e-3
"""What stands for a count of 0, as in fishtest: the likeliest distribution of any mean must exist."""
_HALVINGS = 50

Floats = NDArray[np.float64]


class Verdict(Enum):
    """What a test says."""

    ACCEPTED = "accepted"
    """The entry is better by `elo1`, rather than by `elo0`."""
    REJECTED = "rejected"
    GOING_ON = "going on"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sprt:
    """A test and what it has seen. All of it is numbers: `dataclasses.asdict` is its state for JSON, `Sprt(**state)` restores it.

    Errors
    ------
    ValueError
        `elo0` is not below `elo1`, an error rate is not between 0 and 0.5, or the counts are not five.
    """

    elo0: float
    """At most so much better: the claim that `alpha` protects. Elo of the expected score, draws being half a point."""
    elo1: float
    """At least so much better: the claim that `beta` protects."""
    alpha: float = 0.05
    """How often an entry that is only `elo0` better may be accepted."""
    beta: float = 0.05
    """How often an entry that is `elo1` better may be rejected."""
    counts: Sequence[int] = (0, 0, 0, 0, 0)
    """Pairs by score, in the order of `PAIR_SCORES`. The order in which they came is nothing to the test."""

    def __post_init__(self) -> None:
        if not self.elo0 < self.elo1:
            raise ValueError(f"elo0 is {self.elo0} and elo1 is {self.elo1}; elo0 must be the lower one")
        for name, rate in (("alpha", self.alpha), ("beta", self.beta)):
            if not 0 < rate < 0.5:
                raise ValueError(f"{name} is {rate}; it must be above 0 and below 0.5")
        if len(self.counts) != len(PAIR_SCORES) or min(self.counts) < 0:
            raise ValueError(f"counts are {list(self.counts)}; there must be five, none below 0")
        object.__setattr__(self, "counts", tuple(self.counts))

    @property
    def n_pairs(self) -> int:
        """Pairs seen."""
        return sum(self.counts)

    @property
    def bounds(self) -> tuple[float, float]:
        """Log likelihood ratios at which the test rejects and accepts."""
        return log(self.beta / (1 - self.alpha)), log((1 - self.beta) / self.alpha)

    @property
    def llr(self) -> float:
        """Log likelihood ratio of `elo1` to `elo0`; 0 before the first pair."""
        return float(log_likelihood_ratio(self.counts, elo0=self.elo0, elo1=self.elo1))

    @property
    def verdict(self) -> Verdict:
        """What the counts say. The error rates hold for who stops at the first verdict other than `GOING_ON`."""
        low, high = self.bounds
        llr = self.llr
        return Verdict.ACCEPTED if llr >= high else Verdict.REJECTED if llr <= low else Verdict.GOING_ON

    def add(self, pair_score: float) -> "Sprt":
        """Return the test with one more pair; `pair_score` is one of `PAIR_SCORES`, else `ValueError`."""
        if pair_score not in PAIR_SCORES:
            raise ValueError(f"a pair's score is {pair_score}; it must be one of {', '.join(map(str, PAIR_SCORES))}")
        which = PAIR_SCORES.index(pair_score)
        return replace(self, counts=[count + (place == which) for place, count in enumerate(self.counts)])

    def run(self, pair_scores: Iterable[float]) -> "Sprt":
        """Return the test at its first verdict, or when the pairs run out.

        Give it the pairs in the order in which they were planned: pairs that end early may be those that one side wins.
        """
        test = self
        for score in pair_scores:
            if test.verdict is not Verdict.GOING_ON:
                break
            test = test.add(score)
        return test


def expected_score(elo: float) -> float:
    """Return the points per match that a difference in Elo stands for."""
    return float(1 / (1 + 10 ** (-elo / 400)))


def pair_scores(outcomes: Iterable[Outcome], entry: str) -> list[float]:
    """Return what `entry` scored in each pair that is complete, in the order in which the pairs were planned.

    Parameters
    ----------
    outcomes
        Of one fixture; they come in any order.
    """
    pairs: defaultdict[int, list[float]] = defaultdict(list)
    for outcome in outcomes:
        pairs[LeagueMatchId.parse(outcome.identity).pair].append(outcome.points(entry))
    return [sum(points) for _, points in sorted(pairs.items()) if len(points) == 2]


def log_likelihood_ratio(counts: ArrayLike, *, elo0: float, elo1: float) -> Floats:
    """Return the generalised log likelihood ratio of `elo1` to `elo0`.

    Parameters
    ----------
    counts
        Pairs by score, shape (..., 5): many tests at once.
    """
    seen = np.asarray(counts, dtype=np.float64)
    n_pairs = seen.sum(axis=-1)
    seen = np.where(seen == 0, _UNSEEN, seen)
    one, two = (np.log1p(_tilt(seen, mean) * (_MATCH_SCORES - mean)) for mean in map(expected_score, (elo0, elo1)))
    ratio: Floats = np.where(n_pairs > 0, (seen * (one - two)).sum(axis=-1), 0.0)
    return ratio


def _tilt(seen: Floats, mean: float) -> Floats:
    """Return `t` of the likeliest distribution with a mean, by halving where it must lie; shape (..., 1)."""
    off = _MATCH_SCORES - mean
    low = np.full((*seen.shape[:-1], 1), -1 / (1 - mean))
    high = np.full_like(low, 1 / mean)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        is_left = (seen * off / (1 + middle * off)).sum(axis=-1, keepdims=True) > 0  # it falls in t
        low, high = np.where(is_left, middle, low), np.where(is_left, high, middle)
    return (low + high) / 2


def expected_n_pairs(elo: float, *, elo0: float, elo1: float, deviation: float, alpha: float = 0.05, beta: float = 0.05) -> float:
    """Return about how many pairs a test takes if the entry is truly `elo` better.

    Parameters
    ----------
    deviation
        Standard deviation of a pair's score per match, 0 .. 0.5: about 0.33 where equals draw a tenth of their matches.

    Notes
    -----
    Source: Wald, 1947, for a Brownian motion with the drift and variance of the log likelihood ratio per pair. Overshoot is left
    out, so a short test takes more.
    """
    score, score0, score1 = (expected_score(value) for value in (elo, elo0, elo1))
    drift = (score1 - score0) * (2 * score - score0 - score1) / (2 * deviation**2)
    variance = (score1 - score0) ** 2 / deviation**2
    low, high = log(beta / (1 - alpha)), log((1 - beta) / alpha)
    slope = 2 * drift / variance
    if abs(slope) * (high - low) < 1e-6:
        return -low * high / variance
    is_accepted = expm1(-slope * low) / (exp(-slope * low) - exp(-slope * high))
    return (is_accepted * high + (1 - is_accepted) * low) / drift
