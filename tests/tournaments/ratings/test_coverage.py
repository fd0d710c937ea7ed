"""Made-up leagues, whose truth is known: how often do the intervals hold it, and does a test err no more often than it says?"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import log

import numpy as np
import pytest
from made_leagues import NU, play

from tournaments.ratings.methods import RatingMethod
from tournaments.ratings.rate import rate, rate_normal
from tournaments.ratings.sprt import expected_score, log_likelihood_ratio

DRAWS = (300, 1_000)
"""Of the bootstrap, for each league; the fewer cost less than a hundredth of the coverage."""


@dataclass
class Study:
    """What became of many leagues."""

    covered: list[list[bool]] = field(default_factory=list)
    """By league and entry."""
    ranked: list[list[bool]] = field(default_factory=list)
    sided: list[bool] = field(default_factory=list)


def study(
    elos: Sequence[float],
    n_pairs: int,
    n_leagues: int,
    n_draws: int,
    *,
    side_elo: float = 0.0,
    are_maps_fresh: bool = False,
    luck: float = 0.0,
    method: RatingMethod = rate,
) -> Study:
    names = [f"{number:02}" for number in range(len(elos))]
    true = np.array(elos) - np.mean(elos)
    ranks = 1 + np.argsort(np.argsort(-true))
    seen = Study()
    for seed in range(n_leagues):
        outcomes = play(elos, n_pairs, np.random.default_rng(seed), side_elo=side_elo, luck=luck)
        found = method(names, outcomes, are_maps_fresh=are_maps_fresh, n_draws=n_draws)
        entries = [found.entries[name] for name in names]
        seen.covered.append([entry.elo_low <= elo <= entry.elo_high for entry, elo in zip(entries, true, strict=True)])
        seen.ranked.append([entry.rank_low <= rank <= entry.rank_high for entry, rank in zip(entries, ranks, strict=True)])
        seen.sided.append(found.side_elo_low <= side_elo <= found.side_elo_high)
    return seen


def slack(share: float, n: int) -> float:
    """Return three standard deviations of a share that is seen in `n` tries."""
    return float(3 * (share * (1 - share) / n) ** 0.5)


def test_intervals_cover_the_truth_as_often_as_they_say(size: Callable[[int, int], int]) -> None:
    n_leagues = size(40, 1_000)
    seen = study(np.linspace(-200, 200, 8), 50, n_leagues, size(*DRAWS), side_elo=30)
    covered, ranked, sided = (float(np.mean(what)) for what in (seen.covered, seen.ranked, seen.sided))
    told = f"{covered:.4f} of the intervals, {ranked:.4f} of the rank ranges, {sided:.4f} of the side's intervals in {n_leagues}"

    margin = 0.02 if n_leagues == 1_000 else 0.02 + slack(0.95, 8 * n_leagues)
    assert abs(covered - 0.95) <= margin, told
    assert abs(sided - 0.95) <= 0.02 + slack(0.95, n_leagues), told
    assert ranked >= 0.95 - slack(0.95, 8 * n_leagues), told


def test_intervals_over_matches_cover_as_well(size: Callable[[int, int], int]) -> None:
    n_leagues = size(40, 500)
    seen = study((-150, -50, 50, 150), 10, n_leagues, size(*DRAWS), side_elo=60, are_maps_fresh=True)

    assert abs(np.mean(seen.covered) - 0.95) <= 0.03 + slack(0.95, 4 * n_leagues)


def test_few_pairs_are_no_excuse(size: Callable[[int, int], int]) -> None:
    """Six pairs in all, for five parameters: drawn with replacement alone, a tenth of the truths lies outside."""
    n_leagues = size(60, 1_000)

    assert np.mean(study((0, 0, 0), 2, n_leagues, size(*DRAWS)).covered) >= 0.92 - slack(0.92, 3 * n_leagues)


@pytest.mark.parametrize(("elos", "n_pairs"), [((0, 0, 0, 700), 10), ((-400, -400, 400, 400), 10), ((0, 600), 10)])
def test_who_won_everything_has_an_interval_that_covers(
    elos: tuple[float, ...], n_pairs: int, size: Callable[[int, int], int]
) -> None:
    """Drawn with replacement alone, the interval of the first league's best covers 85%; of the last one's, under 80%."""
    n_leagues = size(60, 500)
    seen = study(elos, n_pairs, n_leagues, size(*DRAWS))

    assert np.mean([league[-1] for league in seen.covered]) >= 0.93 - slack(0.93, n_leagues)


@pytest.mark.parametrize(
    ("elos", "n_pairs", "luck", "are_maps_fresh"),
    [
        ((-200, -80, 0, 80, 200), 15, 0.0, False),
        ((0, 0, 0), 2, 0.0, False),
        ((-150, -50, 50, 150), 3, 0.0, True),
        ((0, 0, 0), 3, 4.0, False),
        ((0, 0, 0, 0), 12, 4.0, False),
        ((0, 0, 0, 700), 10, 0.0, False),
    ],
)  # fmt: skip
def test_intervals_of_the_normal_approximation_cover_too(
    elos: tuple[float, ...], n_pairs: int, luck: float, are_maps_fresh: bool, size: Callable[[int, int], int]
) -> None:
    """Taken for independent, the pairs of the lucky maps that always go alike have intervals that cover under 85%."""
    n_leagues = size(60, 1_000)
    seen = study(elos, n_pairs, n_leagues, 50, luck=luck, are_maps_fresh=are_maps_fresh, method=rate_normal)
    margin = slack(0.95, len(elos) * n_leagues)

    assert 0.92 - margin <= np.mean(seen.covered) <= 0.99 + slack(0.99, n_leagues)


def shares_of(elo: float, *, luck: float, nu: float = NU) -> np.ndarray:
    """Return the chances of a pair's five scores, worth `elo`, on maps that favour a side by `luck` units either way."""

    def shares(d: float) -> np.ndarray:
        every = np.zeros(5)
        for side in (luck, -luck):
            first, second = (np.array([np.exp(-x / 2), nu, np.exp(x / 2)]) for x in (d + side, d - side))
            every += np.convolve(first / first.sum(), second / second.sum()) / 2
        return every

    low, high = -20.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if shares(middle) @ np.arange(5) / 4 < expected_score(elo) else (low, middle)
    return shares(low)


def accepted(shares: np.ndarray, n_tests: int, elo0: float, elo1: float, rng: np.random.Generator) -> tuple[float, float]:
    """Return how many of many tests accepted, each to its end, as a share, and the mean of their pairs."""
    counts = np.zeros((n_tests, 5))
    n_accepted = n_pairs = 0
    while len(counts):
        n_pairs += len(counts)
        counts[np.arange(len(counts)), rng.choice(5, p=shares, size=len(counts))] += 1
        llr = log_likelihood_ratio(counts, elo0=elo0, elo1=elo1)
        n_accepted += int((llr >= log(19)).sum())
        counts = counts[abs(llr) < log(19)]
    return n_accepted / n_tests, n_pairs / n_tests


@pytest.mark.parametrize(("elo0", "elo1", "luck"), [(0, 50, 0.0), (0, 50, 3.0), (0, 200, 0.0), (100, 200, 0.0), (0, 400, 1.0)])
def test_a_sequential_test_errs_no_more_often_than_it_says(
    elo0: float, elo1: float, luck: float, size: Callable[[int, int], int]
) -> None:
    rng = np.random.default_rng(5)
    n_tests = size(1_000, 20_000)
    margin = 0.05 + slack(0.05, n_tests)

    wrong, _ = accepted(shares_of(elo0, luck=luck), n_tests, elo0, elo1, rng)
    right, _ = accepted(shares_of(elo1, luck=luck), n_tests, elo0, elo1, rng)

    assert wrong <= margin
    assert 1 - right <= margin
