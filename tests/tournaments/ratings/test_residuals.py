"""What the ratings do not tell is told; what is only chance is not."""

import itertools
import random
from collections.abc import Callable

import numpy as np
import pytest
from outcomes import met

from arena.game.types import Team
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.ratings.davidson import chances
from tournaments.ratings.rate import Ratings, rate
from tournaments.ratings.residuals import _expected, _reversal_p, find_cycles, find_residuals

WINNERS = (Team.BLUE, None, Team.RED)
SEATS = {team: SeatOutcome() for team in Team}


def play(
    names: str, n_pairs: int, lead: Callable[[str, str], float], *, seed: int = 0, nu: float = 0.2, luck: float = 0.0
) -> list[Outcome]:
    """Return a league in which blue is `lead(blue, red)` units ahead, on maps that favour a side by `luck` units."""
    rng = random.Random(seed)
    outcomes = []
    for one, other in itertools.combinations(names, 2):
        for pair in range(n_pairs):
            side = rng.choice((luck, -luck))
            for blue, red in ((one, other), (other, one)):
                d = lead(blue, red) + (side if blue == one else -side)
                weights = (np.exp(d / 2), nu, np.exp(-d / 2))
                outcomes.append(met(one, other, pair, blue, rng.choices(WINNERS, weights)[0]))
    return outcomes


def rated(names: str, outcomes: list[Outcome]) -> Ratings:
    return rate(list(names), outcomes, n_draws=10)


def by_strength(**strengths: float) -> Callable[[str, str], float]:
    return lambda blue, red: strengths[blue] - strengths[red]


BEATS = {("r", "s"): 1.0, ("s", "p"): 1.0, ("p", "r"): 1.0}


def in_a_circle(blue: str, red: str) -> float:
    return BEATS.get((blue, red), 0) - BEATS.get((red, blue), 0)


def test_a_circle_is_found_and_told() -> None:
    outcomes = play("prsx", 60, in_a_circle)

    (cycle,) = find_cycles(outcomes)

    assert cycle.entries == ("p", "r", "s")
    assert min(cycle.scores) > 0.6
    assert cycle.p < 0.05
    assert cycle.sentence.startswith("p beats r (0.")
    assert cycle.sentence.endswith(": no rating shows that")


def test_a_circle_shows_in_the_residuals() -> None:
    outcomes = play("prsx", 60, in_a_circle)

    found = find_residuals(rated("prsx", outcomes), outcomes)

    assert {(row.one, row.other) for row in found if row.is_significant} == {("p", "r"), ("p", "s"), ("r", "s")}
    assert {(row.one, row.other): row.z > 0 for row in found[:3]} == {("p", "r"): True, ("p", "s"): False, ("r", "s"): True}
    assert "more than the" in next(row for row in found if (row.one, row.other) == ("p", "r")).sentence
    assert [abs(row.z) for row in found] == sorted((abs(row.z) for row in found), reverse=True)


def test_a_circle_needs_enough_pairs() -> None:
    assert find_cycles(play("prsx", 3, in_a_circle)) == ()


def test_the_order_of_the_games_does_not_matter() -> None:
    outcomes = play("prsx", 30, in_a_circle)
    shuffled = outcomes[:]
    random.Random(1).shuffle(shuffled)

    assert find_cycles(outcomes) == find_cycles(shuffled)
    ratings = rated("prsx", outcomes)
    assert find_residuals(ratings, outcomes) == find_residuals(ratings, shuffled)


@pytest.mark.parametrize("luck", [0.0, 3.0])
def test_what_follows_the_model_has_residuals_of_size_one(luck: float, size: Callable[[int, int], int]) -> None:
    """Also on maps that favour a side: pairs are then more even than the model says, and their own variance is what counts."""
    lead = by_strength(a=0, b=0.2, c=0.5, d=0.9, e=1.2)
    zs, significant, n_leagues = [], 0, size(60, 600)
    for seed in range(n_leagues):
        outcomes = play("abcde", 20, lead, seed=seed, luck=luck)
        found = find_residuals(rated("abcde", outcomes), outcomes)
        zs += [row.z for row in found]
        significant += any(row.is_significant for row in found)

    assert np.std(zs) == pytest.approx(1, abs=0.1)
    assert significant / n_leagues <= 0.05 + 3 * (0.05 * 0.95 / n_leagues) ** 0.5


def test_among_equals_no_circle_is_seen(size: Callable[[int, int], int]) -> None:
    n_leagues = size(100, 1_000)

    seen = sum(bool(find_cycles(play("abcdef", 15, lambda _blue, _red: 0, seed=seed))) for seed in range(n_leagues))

    assert seen <= 0.01 * n_leagues


def test_of_two_entries_the_ratings_follow_the_only_fixture() -> None:
    outcomes = play("ab", 30, by_strength(a=0, b=1))

    (row,) = find_residuals(rated("ab", outcomes), outcomes)

    assert row.z == 0
    assert not row.is_significant
    assert row.score == pytest.approx(row.expected, abs=0.01)
    assert row.n_matches == 60


def test_the_favour_of_a_side_is_expected() -> None:
    """`a` plays blue alone, as in a league that was stopped: that it scores more is the side's doing, not a surprise."""
    lead = lambda _blue, _red: 1.0  # noqa: E731
    outcomes = play("abcd", 40, lead)
    kept = [match for match in outcomes if not ({match.blue, match.red} == {"a", "b"} and match.blue == "b")]

    found = find_residuals(rated("abcd", kept), kept)

    row = next(row for row in found if (row.one, row.other) == ("a", "b"))
    assert row.n_matches == 40
    assert row.expected > 0.6
    assert not row.is_significant


def test_without_matches_there_is_nothing_to_tell() -> None:
    assert find_residuals(rated("abc", []), []) == ()
    assert find_cycles([]) == ()


@pytest.mark.parametrize("scores", [[2, 2, 1.5], [0, 0.5, 0.5, 1, 2, 0], [1, 1], [1.5] * 5, [2, 0], [0.5, 0.5, 2, 0, 0, 0, 0.5]])
def test_reversals_are_counted_as_by_hand(scores: list[float]) -> None:
    leads = [score - 1 for score in scores]
    sums = [abs(sum(lead * sign for lead, sign in zip(leads, signs, strict=True)))
            for signs in itertools.product((1, -1), repeat=len(leads))]  # fmt: skip

    assert _reversal_p(scores) == pytest.approx(np.mean([value >= abs(sum(leads)) - 1e-9 for value in sums]))


def test_the_expectations_slope_is_that_of_differences() -> None:
    counts = np.arange(27.0).reshape(3, 3, 3)
    best, step = np.array([0.3, -0.8, 0.5, 0.4, -0.6]), 1e-6

    points, _, slope = _expected(0, 1, counts, chances(best))

    plain = [(_expected(0, 1, counts, chances(best + step * row))[0] - points) / step for row in np.eye(5)]
    np.testing.assert_allclose(slope, plain, atol=1e-4)
