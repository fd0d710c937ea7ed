"""The rule by which a run has converged, on curves whose slope is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from policies.training.convergence import NARROW, Line, Verdict, judge

N_ROUNDS = 2_000
ROUND = 10
"""Matches in a round; the newest half of N_ROUNDS are 10,000 matches."""


def noise(rng: np.random.Generator, n: int, correlated_rounds: float) -> NDArray[np.float64]:
    """Return noise as captures in 10 matches have it, and a policy's that wanders."""
    keeps = np.exp(-1 / correlated_rounds) if correlated_rounds else 0.0
    wandering = np.zeros(n)
    wandering[0] = rng.standard_normal()
    for index, step in enumerate(np.sqrt(1 - keeps**2) * rng.standard_normal(n - 1)):
        wandering[index + 1] = keeps * wandering[index] + step
    return 15.0 * rng.standard_normal(n) + (8.0 * wandering if correlated_rounds else 0.0)


def line(slope: float, spread: NDArray[np.float64] | float = 0.0, n: int = N_ROUNDS) -> Line:
    """Return a run whose score rises by `slope` points in 10,000 matches."""
    episodes = ROUND * np.arange(1.0, n + 1)
    return episodes, 30 + slope * episodes / 10_000 + spread


@pytest.mark.parametrize("correlated_rounds", [0, 10, 50])
def test_the_interval_holds_the_true_slope_in_nineteen_of_twenty_runs(correlated_rounds: float) -> None:
    rng, slope = np.random.default_rng(0), 4.0
    found = [judge([line(slope, noise(rng, N_ROUNDS, correlated_rounds))]) for _ in range(300)]
    held = np.mean([one.low <= slope <= one.high for one in found if one.low is not None and one.high is not None])

    assert 0.92 <= held <= 0.99
    assert np.mean([one.slope for one in found if one.slope is not None]) == pytest.approx(slope, abs=1)


def test_correlation_widens_the_interval() -> None:
    def reach(correlated_rounds: float) -> float:
        found = [judge([line(0, noise(np.random.default_rng(seed), N_ROUNDS, correlated_rounds))]) for seed in range(50)]
        return float(np.median([one.high - one.low for one in found if one.low is not None and one.high is not None]))

    assert reach(50) > 3 * reach(0)


@pytest.mark.parametrize(("slope", "verdict"), [(0.0, Verdict.CONVERGED), (3.0, Verdict.RISES), (-3.0, Verdict.FALLS)])
def test_most_long_runs_are_told_by_their_slope(slope: float, verdict: Verdict) -> None:
    rng, n = np.random.default_rng(1), 10_000

    found = [judge([line(slope, noise(rng, n, 10), n)]).verdict for _ in range(40)]

    assert found.count(verdict) >= 32


def test_a_flat_run_that_is_too_noisy_cannot_be_told() -> None:
    found = judge([line(0, noise(np.random.default_rng(2), N_ROUNDS, 20))])

    assert found.low is not None
    assert found.high is not None
    assert found.low < 0 < found.high
    assert found.high - found.low > 2 * NARROW
    assert found.verdict == Verdict.UNKNOWN


def test_a_slope_that_the_old_rule_took_for_none_is_seen() -> None:
    found = judge([line(4.3, noise(np.random.default_rng(3), 6_000, 0), 6_000)])  # 0.9 points in 2,000 matches

    assert found.verdict == Verdict.RISES


def test_only_the_newest_half_counts() -> None:
    episodes, score = line(0, noise(np.random.default_rng(4), 10_000, 0), 10_000)
    score[:5_000] -= np.linspace(60, 0, 5_000)

    assert judge([(episodes, score)]).verdict == Verdict.CONVERGED


def test_seeds_are_judged_by_their_mean_as_far_as_all_go() -> None:
    rises, falls = line(5), line(-5, n=2 * N_ROUNDS)

    both = judge([rises, falls])

    assert (both.slope, both.verdict) == (0, Verdict.CONVERGED)
    assert [judge([one]).verdict for one in (rises, falls)] == [Verdict.RISES, Verdict.FALLS]


@pytest.mark.parametrize("n", [1, 78])
def test_a_run_of_few_rounds_cannot_be_told(n: int) -> None:
    found = judge([line(0, n=n)])

    assert (found.slope, found.low, found.high, found.verdict) == (None, None, None, Verdict.UNKNOWN)


def test_a_score_that_never_moves_has_converged() -> None:
    found = judge([line(0)])

    assert (found.slope, found.low, found.high, found.verdict) == (0, 0, 0, Verdict.CONVERGED)
