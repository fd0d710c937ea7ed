"""A sequential test against a plain optimiser, and what its verdicts are worth; `test_coverage` counts its errors."""

import json
import random
from dataclasses import asdict

import numpy as np
import pytest
from outcomes import met
from scipy.optimize import minimize

from arena.game.types import Team
from tournaments.outcome import Outcome
from tournaments.ratings.sprt import (
    PAIR_SCORES,
    Sprt,
    Verdict,
    expected_n_pairs,
    expected_score,
    log_likelihood_ratio,
    pair_scores,
)


def outcome(pair: int, blue: str, winner: Team | None) -> Outcome:
    return met("a", "b", pair, blue, winner)


def likelihood(counts: list[int], mean: float) -> float:
    """Return the log likelihood of the likeliest distribution with a mean, by a plain optimiser."""
    shares = np.array(counts) / sum(counts)
    best = minimize(
        lambda p: -(shares * np.log(p)).sum(),
        np.full(5, 0.2),
        bounds=[(1e-9, 1)] * 5,
        constraints=[
            {"type": "eq", "fun": lambda p: p.sum() - 1},
            {"type": "eq", "fun": lambda p: p @ np.array(PAIR_SCORES) / 2 - mean},
        ],
        options={"ftol": 1e-14, "maxiter": 1_000},
    )
    return float(-sum(counts) * best.fun)


@pytest.mark.parametrize("counts", [[10, 20, 30, 25, 15], [1, 1, 1, 1, 1], [2, 7, 40, 30, 60]])
def test_the_ratio_is_that_of_a_plain_optimiser(counts: list[int]) -> None:
    for elo0, elo1 in ((0, 50), (-100, 30), (100, 300)):
        plain = likelihood(counts, expected_score(elo1)) - likelihood(counts, expected_score(elo0))

        assert float(log_likelihood_ratio(counts, elo0=elo0, elo1=elo1)) == pytest.approx(plain, abs=2e-3)


def test_near_evenness_the_ratio_is_that_of_the_sample_variance() -> None:
    counts = np.array([1_000, 2_000, 3_100, 2_100, 1_050])
    scores = np.arange(5) / 4
    score = counts @ scores / counts.sum()
    variance = counts @ (scores - score) ** 2 / counts.sum()
    s0, s1 = expected_score(0), expected_score(5)

    shortcut = counts.sum() * (s1 - s0) * (2 * score - s0 - s1) / (2 * variance)

    assert float(log_likelihood_ratio(counts, elo0=0, elo1=5)) == pytest.approx(shortcut, rel=0.02)


def test_before_the_first_pair_nothing_is_known() -> None:
    test = Sprt(elo0=0, elo1=50)

    assert (test.llr, test.n_pairs, test.verdict) == (0, 0, Verdict.GOING_ON)


def test_the_bounds_are_walds() -> None:
    low, high = Sprt(elo0=0, elo1=50, alpha=0.05, beta=0.1).bounds

    assert (low, high) == (pytest.approx(np.log(0.1 / 0.95)), pytest.approx(np.log(0.9 / 0.05)))


def test_the_better_is_accepted_and_the_equal_rejected() -> None:
    rng = random.Random(1)
    better = Sprt(elo0=0, elo1=100).run(rng.choice((1.0, 1.5, 2.0, 0.5, 2.0)) for _ in range(1_000))
    equal = Sprt(elo0=0, elo1=100).run(rng.choice((0.0, 1.0, 1.0, 2.0)) for _ in range(1_000))

    assert (better.verdict, equal.verdict) == (Verdict.ACCEPTED, Verdict.REJECTED)
    assert better.n_pairs < 100
    assert equal.n_pairs < 300


def test_two_pairs_that_went_alike_decide_nothing() -> None:
    for score in PAIR_SCORES:
        assert Sprt(elo0=0, elo1=50).add(score).add(score).verdict is Verdict.GOING_ON


@pytest.mark.parametrize("score", PAIR_SCORES)
def test_a_better_pair_speaks_more_for_the_entry(score: float) -> None:
    test = Sprt(elo0=0, elo1=50, counts=(3, 5, 9, 6, 4))

    assert score == 2.0 or test.add(score).llr < test.add(score + 0.5).llr
    assert (test.add(score).llr < test.llr) is (score <= 1.0)


def test_the_other_entry_sees_the_test_reversed() -> None:
    counts = (3, 5, 9, 6, 4)

    assert Sprt(elo0=0, elo1=50, counts=counts).llr == pytest.approx(-Sprt(elo0=-50, elo1=0, counts=counts[::-1]).llr)


def test_the_order_of_pairs_is_nothing_to_the_ratio_and_the_state_survives_json() -> None:
    scores = [0.0, 1.5, 2.0, 1.0, 1.0, 0.5, 2.0]
    test, same = Sprt(elo0=0, elo1=50), Sprt(elo0=0, elo1=50)
    for score in scores:
        test = test.add(score)
    for score in reversed(scores):
        same = same.add(score)

    assert test == same == Sprt(**json.loads(json.dumps(asdict(test))))
    assert test.counts == (1, 1, 2, 1, 2)


def test_a_run_stops_at_its_first_verdict() -> None:
    left = iter([2.0] * 500)

    test = Sprt(elo0=0, elo1=100).run(left)

    assert test.verdict is Verdict.ACCEPTED
    assert Sprt(elo0=0, elo1=100, counts=(0, 0, 0, 0, test.n_pairs - 1)).verdict is Verdict.GOING_ON
    assert test.n_pairs + len(list(left)) >= 499  # a pair is at most looked at


@pytest.mark.parametrize(
    "wrong", [{"elo0": 50, "elo1": 50}, {"alpha": 0}, {"beta": 0.5}, {"counts": (1, 2, 3)}, {"counts": (0, 0, -1, 0, 0)}]
)
def test_a_test_that_makes_no_sense_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"must be"):
        Sprt(**{"elo0": 0, "elo1": 50} | wrong)


def test_a_score_that_no_pair_has_is_refused() -> None:
    with pytest.raises(ValueError, match=r"one of 0\.0, 0\.5, 1\.0, 1\.5, 2\.0"):
        Sprt(elo0=0, elo1=50).add(0.75)


def test_pairs_are_scored_in_the_order_in_which_they_were_planned() -> None:
    outcomes = [
        outcome(10_000, "b", None), outcome(10_000, "a", Team.BLUE),
        outcome(1, "a", Team.RED), outcome(1, "b", Team.BLUE),
        outcome(2, "a", Team.BLUE), outcome(2, "b", Team.RED),
        outcome(9_999, "a", Team.RED), outcome(9_999, "b", None),
        outcome(3, "a", Team.BLUE),
    ]  # fmt: skip

    assert pair_scores(outcomes, "a") == [0, 2, 0.5, 1.5]
    assert pair_scores(outcomes, "b") == [2, 0, 1.5, 0.5]


def test_pairs_are_foretold() -> None:
    """At either claim, about what Wald's formula for the mean sample number says; in the middle, the most."""
    told = [expected_n_pairs(elo, elo0=0, elo1=50, deviation=0.332) for elo in (-100, 0, 25, 50, 150)]

    assert told[1] == pytest.approx(told[3], rel=0.01) == pytest.approx(114, abs=2)
    assert told[2] == max(told) == pytest.approx(np.log(19) ** 2 * (0.332 / (expected_score(50) - 0.5)) ** 2, rel=0.01)
    assert told[0] < told[1]
    assert told[4] < told[3]


def test_scores_that_were_never_seen_weigh_next_to_nothing() -> None:
    """If every pair was won, the likeliest distributions are wins as often as the claims allow, and the rest losses."""
    ratio = float(log_likelihood_ratio((0, 0, 0, 0, 20), elo0=0, elo1=50))

    assert ratio == pytest.approx(20 * np.log(expected_score(50) / expected_score(0)), rel=0.01)
