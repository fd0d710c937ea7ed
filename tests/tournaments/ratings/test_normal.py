"""The normal approximation: beside the bootstrap, and where nothing is known."""

import numpy as np
import pytest
from made_leagues import play
from outcomes import met

from arena.game.types import Team
from tournaments.ratings.bootstrap import count
from tournaments.ratings.davidson import ELO, PRIOR_STRENGTH, fit
from tournaments.ratings.methods import find_method
from tournaments.ratings.normal import fit_counts
from tournaments.ratings.rate import rate, rate_normal, units_of

NAMES = ["00", "01", "02", "03", "04", "05"]


@pytest.mark.parametrize("are_maps_fresh", [False, True])
def test_it_agrees_with_the_bootstrap(are_maps_fresh: bool) -> None:
    outcomes = play((-150, -90, -30, 30, 90, 150), 12, np.random.default_rng(3), side_elo=40)

    drawn, curved = (method(NAMES, outcomes, are_maps_fresh=are_maps_fresh) for method in (rate, find_method("normal")))

    for name, one in drawn.entries.items():
        other = curved.entries[name]
        assert other.elo == pytest.approx(one.elo, abs=1e-6)
        assert other.elo_high - other.elo_low == pytest.approx(one.elo_high - one.elo_low, rel=0.25)
        assert abs(other.rank_low - one.rank_low) <= 1
        assert abs(other.rank_high - one.rank_high) <= 1
        assert other.rank == one.rank
    for pair, share in drawn.superiority.items():
        assert curved.superiority[pair] == pytest.approx(share, abs=0.1)
    assert curved.side_elo == pytest.approx(drawn.side_elo, abs=1e-6)
    assert curved.side_elo_high - curved.side_elo_low == pytest.approx(drawn.side_elo_high - drawn.side_elo_low, rel=0.25)
    assert curved.draw_rate == pytest.approx(drawn.draw_rate)


def test_it_says_the_same_every_time_in_whatever_order() -> None:
    outcomes = play((0, 50, 100), 4, np.random.default_rng(1))

    assert rate_normal(["00", "01", "02"], outcomes) == rate_normal(["02", "00", "01"], outcomes[::-1])


def test_pairs_that_go_alike_say_no_more_than_one_match_each() -> None:
    outcomes = [met("a", "b", pair, blue, Team.BLUE if (blue == "a") == (pair % 2 == 0) else Team.RED)
                for pair in range(60) for blue in ("a", "b")]  # fmt: skip

    paired, fresh = (rate_normal(["a", "b"], outcomes, are_maps_fresh=are).entries["a"] for are in (False, True))

    assert paired.elo == fresh.elo
    assert (paired.elo_high - paired.elo_low) / (fresh.elo_high - fresh.elo_low) == pytest.approx(2**0.5, rel=0.05)


def test_maps_that_favour_a_side_make_strengths_more_certain_and_the_side_less() -> None:
    outcomes = [met("a", "b", pair, blue, Team.BLUE if pair % 2 else Team.RED) for pair in range(60) for blue in ("a", "b")]

    paired, fresh = (rate_normal(["a", "b"], outcomes, are_maps_fresh=are) for are in (False, True))

    assert paired.entries["a"].elo_high < fresh.entries["a"].elo_high / 2
    assert paired.side_elo_high > 1.3 * fresh.side_elo_high


def test_without_a_match_all_that_is_known_is_the_prior() -> None:
    known = fit_counts(np.zeros((3, 3, 3)))

    assert not known.strengths.any()
    np.testing.assert_allclose(np.diag(known.covariance)[:3], PRIOR_STRENGTH**2)
    ratings = rate_normal(["a", "b", "c"], []).entries
    assert all((one.rank_low, one.rank_high) == (1, 3) for one in ratings.values())


def test_an_entry_that_won_everything_may_be_anything_above() -> None:
    outcomes = [met("a", "z", pair, blue, Team.BLUE if blue == "z" else Team.RED)
                for pair in range(10) for blue in ("a", "z")]  # fmt: skip

    best = rate_normal(["a", "z"], outcomes).entries["z"]

    assert -50 < best.elo_low < 200
    assert 800 < best.elo_high < 3_000


def test_counts_alone_are_enough_and_an_earlier_posterior_is_a_start() -> None:
    outcomes = play((0, 50, 100), 6, np.random.default_rng(2))
    counts = count(3, units_of(["00", "01", "02"], outcomes, are_maps_fresh=False)[0])

    known = fit_counts(counts)

    np.testing.assert_allclose(known.parameters, fit(counts[None])[0])
    np.testing.assert_allclose(fit_counts(counts, start=known).covariance, known.covariance, atol=1e-8)
    elo, covariance = known.centred
    assert elo.sum() == pytest.approx(0, abs=1e-9)
    d = known.difference_deviations
    np.testing.assert_allclose((ELO * d[0, 1]) ** 2, covariance[0, 0] + covariance[1, 1] - 2 * covariance[0, 1])
