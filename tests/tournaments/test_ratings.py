"""Ratings against what is known, and against a plain optimiser."""

import random
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from arena.game.types import Ending, Team
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.ratings import ELO, PRIOR_DRAW, PRIOR_SIDE, PRIOR_STRENGTH, bootstrap, fit, rate
from tournaments.standings import stand

WINNERS = (Team.BLUE, None, Team.RED)


def outcome(one: str, other: str, pair: int, blue: str, winner: Team | None) -> Outcome:
    red = other if blue == one else one
    return Outcome(
        identity=f"l/{one}/{other}/{pair:04}/{blue}-blue/0",
        blue=blue,
        red=red,
        ending=Ending.CAPTURE,
        winner=winner,
        score=0,
        ticks=10,
        reason="",
        seats={team: SeatOutcome() for team in Team},
    )


def played(strengths: dict[str, float], n_pairs: int, *, side: float = 0.0, nu: float = 0.2, seed: int = 0) -> list[Outcome]:
    """Return a made-up league that follows the model."""
    rng = np.random.default_rng(seed)
    names = sorted(strengths)
    outcomes = []
    for number, one in enumerate(names):
        for other in names[number + 1 :]:
            for pair in range(n_pairs):
                for blue, red in ((one, other), (other, one)):
                    d = strengths[blue] - strengths[red] + side
                    odds = np.array([np.exp(d / 2), nu, np.exp(-d / 2)])
                    outcomes.append(outcome(one, other, pair, blue, WINNERS[rng.choice(3, p=odds / odds.sum())]))
    return outcomes


def count(names: list[str], outcomes: list[Outcome]) -> np.ndarray:
    counts = np.zeros((len(names), len(names), 3))
    for match in outcomes:
        counts[names.index(match.blue), names.index(match.red), WINNERS.index(match.winner)] += 1
    return counts


def test_the_fit_is_the_optimum_that_a_plain_optimiser_finds() -> None:
    names = ["a", "b", "c", "d"]
    counts = count(names, played(dict(zip(names, (0, 0.5, 1, 3), strict=True)), 6, side=0.3))

    def loss(parameters: np.ndarray) -> float:
        strength, side, draw = parameters[:4], parameters[4], parameters[5]
        total = (strength**2).sum() / 2 / PRIOR_STRENGTH**2 + side**2 / 2 / PRIOR_SIDE**2 + draw**2 / 2 / PRIOR_DRAW**2
        for i in range(4):
            for j in range(4):
                d = strength[i] - strength[j] + side
                logits = np.array([d / 2, draw, -d / 2])
                total -= counts[i, j] @ (logits - np.log(np.exp(logits).sum()))
        return float(total)

    best = minimize(loss, np.zeros(6), method="BFGS", options={"gtol": 1e-8})

    np.testing.assert_allclose(fit(counts[None])[0], best.x, atol=1e-5)


def test_a_three_to_one_score_is_the_textbooks_difference() -> None:
    """Without draws or sides, 75% of the points are 400 * log10(3) = 191 Elo."""
    outcomes = [
        outcome("a", "b", pair, blue, Team.BLUE if (blue == "a") == (pair % 4 != 0) else Team.RED)
        for pair in range(2_000)
        for blue in ("a", "b")
    ]

    ratings = rate(["a", "b"], outcomes, n_draws=50).entries

    assert ratings["a"].elo - ratings["b"].elo == pytest.approx(400 * np.log10(3), abs=0.5)
    assert ratings["a"].elo + ratings["b"].elo == pytest.approx(0, abs=1e-9)


def test_the_side_and_the_draws_are_found() -> None:
    found = rate(["a", "b", "c"], played({"a": 0, "b": 0.5, "c": 1}, 1_500, side=0.4, nu=0.5), n_draws=200)

    assert found.side_elo == pytest.approx(0.4 * ELO, abs=10)
    assert found.side_elo_low < 0.4 * ELO < found.side_elo_high
    assert found.draw_rate == pytest.approx(0.2, abs=0.02)


def test_the_order_of_the_games_does_not_matter() -> None:
    outcomes = played({"a": 0, "b": 0.5, "c": 1}, 5)
    shuffled = outcomes[:]
    random.Random(1).shuffle(shuffled)

    assert rate(["a", "b", "c"], outcomes, n_draws=100) == rate(["c", "a", "b"], shuffled, n_draws=100)


def test_another_win_never_lowers_a_rating() -> None:
    outcomes = played({"a": 0, "b": 0.5, "c": 1}, 5)
    before = rate(["a", "b", "c"], outcomes, n_draws=10).entries["a"].elo
    worse = next(i for i, match in enumerate(outcomes) if match.blue == "a" and match.winner is Team.RED)
    old = outcomes[worse]
    for winner in (None, Team.BLUE):
        outcomes[worse] = Outcome(**{name: getattr(old, name) for name in Outcome.__slots__} | {"winner": winner})
        after = rate(["a", "b", "c"], outcomes, n_draws=10).entries["a"].elo
        assert after > before
        before = after


@pytest.mark.parametrize("n_pairs", [1, 20])
def test_who_won_everything_has_a_finite_rating_and_a_wide_interval(n_pairs: int) -> None:
    outcomes = played({"a": 0, "b": 0.3}, n_pairs)
    for pair in range(n_pairs):
        for other in ("a", "b"):
            outcomes += [outcome(other, "z", pair, blue, Team.BLUE if blue == "z" else Team.RED) for blue in (other, "z")]

    best = rate(["a", "b", "z"], outcomes, n_draws=300).entries["z"]

    assert best.rank == best.rank_low == best.rank_high == 1 or n_pairs == 1
    assert 0 < best.elo < 3_000
    assert best.elo_high - best.elo_low > 50


def test_a_league_without_a_match_knows_nothing() -> None:
    ratings = rate(["a", "b", "c"], [], n_draws=200).entries

    assert {rating.elo for rating in ratings.values()} == {0.0}
    assert all((rating.rank_low, rating.rank_high) == (1, 3) for rating in ratings.values())


def test_intervals_cover_what_is_true_about_as_often_as_they_say(size: Callable[[int, int], int]) -> None:
    strengths = dict(zip("abcd", (-0.6, -0.2, 0.2, 0.6), strict=True))
    n_leagues = size(60, 1_000)
    covered = 0
    for seed in range(n_leagues):
        found = rate(list(strengths), played(strengths, 15, seed=seed), n_draws=200).entries
        covered += sum(found[name].elo_low <= ELO * strengths[name] <= found[name].elo_high for name in strengths)

    assert 0.89 <= covered / (4 * n_leagues) <= 0.99


def test_a_bootstrap_draws_whole_pairs() -> None:
    """Two games that always go alike tell no more than one: the interval must be wider than of games drawn apart."""
    alike = {(((0, 1, 0), (1, 0, 2))): 20, (((0, 1, 2), (1, 0, 0))): 20}
    apart = {((0, 1, 0),): 20, ((1, 0, 2),): 20, ((0, 1, 2),): 20, ((1, 0, 0),): 20}
    spread = [np.std(np.diff(bootstrap(2, kinds, np.zeros(4), 1_000)[:, :2])) for kinds in (alike, apart)]

    assert spread[0] / spread[1] == pytest.approx(2**0.5, rel=0.15)


def test_a_forfeit_is_counted_against_who_lost_and_a_favoured_side_is_noticed() -> None:
    outcomes = [outcome("a", "b", pair, blue, Team.BLUE) for pair in range(10) for blue in ("a", "b")]
    outcomes[0] = Outcome(**{name: getattr(outcomes[0], name) for name in Outcome.__slots__} | {"ending": Ending.FORFEIT})

    found = stand(["a", "b"], outcomes, n_draws=50)

    assert {row.name: row.forfeits for row in found.rows} == {"a": 0, "b": 1}
    assert found.side.is_significant
    assert found.side.bias == 1
    assert (found.cross["a", "b"].wins, found.cross["b", "a"].wins) == (10, 10)
