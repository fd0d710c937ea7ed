"""Versions of one entry share what they have in common if the data say so, and only then."""

from collections.abc import Callable

import numpy as np
import pytest
from made_leagues import play

from tournaments.ratings.bootstrap import count
from tournaments.ratings.davidson import ELO
from tournaments.ratings.links import choose_links
from tournaments.ratings.normal import Posterior, fit_counts
from tournaments.ratings.rate import rate, rate_normal, units_of

N_VERSIONS = 3
MEANS = np.array([-200.0, -50.0, 50.0, 200.0])
"""Elo of four entries, around 0."""
FOLLOWS = [(first + version, first + version + 1) for first in range(0, 12, N_VERSIONS) for version in range(N_VERSIONS - 1)]
NAMES = [f"{number:02}" for number in range(12)]


def fitted(elos: np.ndarray, n_pairs: int, seed: int) -> tuple[Posterior, Posterior]:
    """Return what is known of a made-up league without links, and with those that its data favour."""
    outcomes = play(elos, n_pairs, np.random.default_rng(seed))
    pairs = units_of(NAMES, outcomes, are_maps_fresh=False)[0]
    return fit_counts(count(12, pairs), pairs), fit_counts(count(12, pairs), pairs, follows=FOLLOWS)


def errors(known: Posterior, elos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far off each rating is, and its standard error."""
    elo, covariance = known.centred
    return elo - (elos - elos.mean()), np.sqrt(np.diag(covariance))


@pytest.mark.parametrize("step", [0.0, 60.0])
def test_versions_that_are_alike_are_linked_and_their_smaller_intervals_cover_as_well(
    step: float, size: Callable[[int, int], int]
) -> None:
    n_leagues = size(12, 200)
    offs, deviations, widths = [], [], []
    for seed in range(n_leagues):
        steps = np.random.default_rng(10_000 + seed).normal(0, step, size=(4, N_VERSIONS))
        elos = (MEANS[:, None] + steps.cumsum(axis=1)).ravel()
        apart, linked = fitted(elos, 3, seed)
        off, deviation = errors(linked, elos)
        offs.append(off)
        deviations.append(deviation)
        widths.append(deviation.mean() / errors(apart, elos)[1].mean())
    covered = np.mean(np.abs(offs) <= 1.96 * np.array(deviations))

    assert np.mean(widths) < (0.8 if step == 0 else 0.95)
    assert covered >= 0.91 - 3 * (0.91 * 0.09 / (12 * n_leagues)) ** 0.5


def test_versions_that_differ_as_entries_do_are_not_pulled_together(size: Callable[[int, int], int]) -> None:
    n_linked = 0
    n_leagues = size(10, 200)
    for seed in range(n_leagues):
        elos = np.random.default_rng(10_000 + seed).permutation(np.linspace(-330, 330, 12))
        n_linked += fitted(elos, 6, seed)[1].links is not None

    assert n_linked <= 0.2 * n_leagues


def test_a_version_that_is_another_bot_stays_where_its_matches_put_it() -> None:
    elos = np.repeat(MEANS, N_VERSIONS)
    elos[2] += 600
    apart, linked = fitted(elos, 6, 1)

    assert linked.links is not None
    assert (1, 2) not in linked.links.pairs
    assert (0, 1) in linked.links.pairs
    assert linked.strengths[2] == pytest.approx(apart.strengths[2], abs=40 / ELO)


def test_where_the_data_favour_no_link_all_is_as_without_versions() -> None:
    outcomes = play((-300, 300, 100, -100), 6, np.random.default_rng(1))
    names = ["00", "01", "02", "03"]
    follows = [("00", "01"), ("02", "03"), ("03", "04")]

    for method in (rate, rate_normal):
        assert method(names, outcomes, n_draws=50, follows=follows) == method(names, outcomes, n_draws=50)


def test_the_bootstrap_links_versions_as_the_normal_approximation_does() -> None:
    outcomes = play(np.repeat(MEANS, N_VERSIONS), 4, np.random.default_rng(4))
    follows = [(NAMES[before], NAMES[after]) for before, after in FOLLOWS]

    apart, drawn, curved = (
        rate(NAMES, outcomes, n_draws=300), rate(NAMES, outcomes, n_draws=300, follows=follows),
        rate_normal(NAMES, outcomes, follows=follows),
    )  # fmt: skip

    widths = [np.mean([one.elo_high - one.elo_low for one in found.entries.values()]) for found in (apart, drawn, curved)]
    assert widths[1] < 0.85 * widths[0]
    assert widths[1] == pytest.approx(widths[2], rel=0.15)
    for name in NAMES:
        assert drawn.entries[name].elo == pytest.approx(curved.entries[name].elo, abs=1e-6)


def test_nothing_is_linked_before_anything_was_played() -> None:
    assert choose_links(np.zeros(2), np.full((2, 2), 5.6), [(0, 1)]) is None
    assert choose_links(np.zeros(2), np.full((2, 2), 5.6), []) is None
