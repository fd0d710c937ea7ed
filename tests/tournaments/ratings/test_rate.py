"""Ratings against what is known, and against a plain optimiser."""

import random
from itertools import combinations

import evalica
import numpy as np
import pytest
from outcomes import changed, met
from scipy.optimize import minimize

from arena.game.types import Team, Termination
from tournaments.outcome import Outcome
from tournaments.ratings.bootstrap import UNSEEN, bootstrap, unseen
from tournaments.ratings.davidson import ELO, PRIOR_DRAW, PRIOR_SIDE, PRIOR_STRENGTH, fit
from tournaments.ratings.rate import rate, units_of
from tournaments.ratings.standings import stand

WINNERS = (Team.BLUE, None, Team.RED)


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
                    outcomes.append(met(one, other, pair, blue, WINNERS[rng.choice(3, p=odds / odds.sum())]))
    return outcomes


def count(names: list[str], outcomes: list[Outcome]) -> np.ndarray:
    counts = np.zeros((len(names), len(names), 3))
    for match in outcomes:
        counts[names.index(match.blue), names.index(match.red), WINNERS.index(match.result.winner)] += 1
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
        met("a", "b", pair, blue, Team.BLUE if (blue == "a") == (pair % 4 != 0) else Team.RED)
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
    worse = next(i for i, match in enumerate(outcomes) if match.blue == "a" and match.result.winner is Team.RED)
    old = outcomes[worse]
    for winner in (None, Team.BLUE):
        outcomes[worse] = changed(old, winner=winner)
        after = rate(["a", "b", "c"], outcomes, n_draws=10).entries["a"].elo
        assert after > before
        before = after


@pytest.mark.parametrize("n_pairs", [1, 20])
def test_who_won_everything_has_a_finite_rating_and_a_wide_interval(n_pairs: int) -> None:
    outcomes = played({"a": 0, "b": 0.3}, n_pairs)
    for pair in range(n_pairs):
        for other in ("a", "b"):
            outcomes += [met(other, "z", pair, blue, Team.BLUE if blue == "z" else Team.RED) for blue in (other, "z")]

    best = rate(["a", "b", "z"], outcomes, n_draws=300).entries["z"]

    assert best.rank == best.rank_low == best.rank_high == 1 or n_pairs == 1
    assert 0 < best.elo < 3_000
    assert best.elo_high - best.elo_low > 300
    assert best.elo_high < 4_000


def test_a_league_without_a_match_knows_nothing() -> None:
    ratings = rate(["a", "b", "c"], [], n_draws=200).entries

    assert {rating.elo for rating in ratings.values()} == {0.0}
    assert all((rating.rank_low, rating.rank_high) == (1, 3) for rating in ratings.values())


def test_a_bootstrap_draws_whole_pairs() -> None:
    """Two games that always go alike tell no more than one: the interval must be wider than of games drawn apart."""
    alike = {(((0, 1, 0), (1, 0, 2))): 20, (((0, 1, 2), (1, 0, 0))): 20}
    apart = {((0, 1, 0),): 20, ((1, 0, 2),): 20, ((0, 1, 2),): 20, ((1, 0, 0),): 20}
    spread = [np.std(np.diff(bootstrap(2, [kinds], np.zeros(4), 1_000)[:, :2])) for kinds in (alike, apart)]

    assert spread[0] / spread[1] == pytest.approx(2**0.5, rel=0.15)


def test_a_forfeit_is_counted_against_who_lost_and_a_favoured_side_is_noticed() -> None:
    outcomes = [met("a", "b", pair, blue, Team.BLUE) for pair in range(10) for blue in ("a", "b")]
    outcomes[0] = changed(outcomes[0], ending=Termination.FORFEIT)

    found = stand(["a", "b"], outcomes, n_draws=50)

    assert {row.name: row.forfeits for row in found.rows} == {"a": 0, "b": 1}
    assert found.side.is_significant
    assert found.side.bias == 1
    assert (found.cross["a", "b"].wins, found.cross["b", "a"].wins) == (10, 10)


def test_strengths_are_those_of_another_library() -> None:
    """Without draws or sides, this is Bradley and Terry's model, which evalica fits by Newman's iteration."""
    strengths = dict(zip("abcdef", (-1.0, -0.4, -0.1, 0.2, 0.5, 0.8), strict=True))
    outcomes = played(strengths, 400, nu=0.0)
    winners = [evalica.Winner.X if match.result.winner is Team.BLUE else evalica.Winner.Y for match in outcomes]

    theirs = evalica.bradley_terry(
        [match.blue for match in outcomes], [match.red for match in outcomes], winners, tolerance=1e-12, limit=10_000
    ).scores
    ours = rate(list(strengths), outcomes, n_draws=10).entries

    assert sorted(strengths, key=lambda name: ours[name].elo) == sorted(strengths, key=lambda name: theirs[name])
    for one, other in combinations(strengths, 2):
        difference = ELO * np.log(theirs[one] / theirs[other])
        assert ours[one].elo - ours[other].elo == pytest.approx(difference, abs=0.5)


def test_superiority_is_sure_of_the_far_and_not_of_the_near() -> None:
    found = rate(["a", "b", "c"], played({"a": 0, "b": 0.05, "c": 3}, 40), n_draws=500)

    assert found.superiority["c", "a"] > 0.99
    assert 0.05 < found.superiority["b", "a"] < 0.95
    for (one, other), share in found.superiority.items():
        assert share + found.superiority[other, one] == pytest.approx(1)
    assert len(found.superiority) == 6


def test_of_two_that_never_met_anybody_either_may_be_the_better() -> None:
    found = rate(["a", "b"], [], n_draws=500).superiority

    assert found["a", "b"] == pytest.approx(0.5, abs=0.08)


def test_superiority_agrees_with_the_rank_of_the_draws() -> None:
    found = rate(["a", "b"], played({"a": 0, "b": 0.3}, 30), n_draws=1_000)

    better = "a" if found.entries["a"].elo > found.entries["b"].elo else "b"
    worse = "b" if better == "a" else "a"
    assert found.superiority[better, worse] > 0.5
    assert (found.superiority[better, worse] > 0.975) is (found.entries[better].elo_low > found.entries[worse].elo_high)


def test_with_fresh_maps_a_match_is_drawn_by_itself() -> None:
    """Pairs whose matches always go alike say half as much as as many single matches; the rating is the same."""
    outcomes = [met("a", "b", pair, blue, Team.BLUE if (blue == "a") == (pair % 2 == 0) else Team.RED)
                for pair in range(60) for blue in ("a", "b")]  # fmt: skip

    paired, fresh = (rate(["a", "b"], outcomes, are_maps_fresh=are, n_draws=1_000).entries["a"] for are in (False, True))

    assert paired.elo == fresh.elo
    assert (paired.elo_high - paired.elo_low) / (fresh.elo_high - fresh.elo_low) == pytest.approx(2**0.5, rel=0.1)


def test_with_fresh_maps_as_many_matches_are_drawn_of_each_side() -> None:
    """If blue always wins, all that varies is how often each was blue; that was planned, and must not make anybody stronger."""
    outcomes = [met("a", "b", pair, blue, Team.BLUE) for pair in range(200) for blue in ("a", "b")]

    assert [sum(units.values()) for units in units_of(["a", "b"], outcomes, are_maps_fresh=True)] == [200, 200]
    found = rate(["a", "b"], outcomes, are_maps_fresh=True, n_draws=500)

    assert found.is_side_favoured
    assert found.side_elo_low > 300
    assert abs(found.entries["a"].elo) < 1


def test_a_side_that_is_not_favoured_is_not_called_so() -> None:
    assert not rate(["a", "b"], played({"a": 0, "b": 0.5}, 100, seed=3), n_draws=500).is_side_favoured


def test_entries_that_nothing_tells_apart_have_alike_intervals() -> None:
    """Each of `b` and `c` won everything against the one that both met."""
    outcomes = [met("a", other, pair, blue, Team.BLUE if blue == other else Team.RED)
                for other in ("b", "c") for pair in range(20) for blue in ("a", other)]  # fmt: skip

    found = rate(["a", "b", "c"], outcomes).entries

    assert found["b"].elo == pytest.approx(found["c"].elo)
    assert found["b"].elo_low == pytest.approx(found["c"].elo_low, abs=60)
    assert found["b"].elo_high == pytest.approx(found["c"].elo_high, abs=200)


def test_what_is_never_seen_is_not_held_for_impossible() -> None:
    """Of 20 matches won, a chance to lose of 0.07 is no surprise: Jeffreys' interval for 0 of 20 ends at 0.117."""
    outcomes = [met("a", "z", pair, blue, Team.BLUE if blue == "z" else Team.RED)
                for pair in range(10) for blue in ("a", "z")]  # fmt: skip

    found = rate(["a", "z"], outcomes).entries["z"]

    assert 2 * found.elo_low == pytest.approx(400 * np.log10(0.883 / 0.117), abs=80)
    assert found.elo_low < found.elo < found.elo_high


def test_each_entry_and_each_group_may_lose_what_it_never_lost() -> None:
    """Shapes of Gamma weights: half a win off each of two that won everything, and half off a group that no other ever beat."""
    alike, groups = np.zeros((3, 3, 3)), np.zeros((4, 4, 3))
    for best in (1, 2):
        alike[0, best, 2] = alike[best, 0, 0] = 20
    for high, low in ((2, 0), (2, 1), (3, 0), (3, 1)):
        groups[low, high, 2] = groups[high, low, 0] = 20
    groups[[0, 1, 2, 3], [1, 0, 3, 2], 0] = groups[[0, 1, 2, 3], [1, 0, 3, 2], 2] = 10

    lost = unseen(alike, fit(alike[None])[0])
    crossed = unseen(groups, fit(groups[None])[0])

    for best in (1, 2):
        assert lost[0, best, 0] + lost[best, 0, 2] >= UNSEEN - 1e-9
    assert crossed[:2, 2:, 0].sum() + crossed[2:, :2, 2].sum() >= UNSEEN - 1e-9
