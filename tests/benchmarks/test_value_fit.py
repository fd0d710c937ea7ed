import numpy as np
import pytest

from arena.game.ruleset import load as load_rules
from benchmarks.measuring.value_fit import collect, fit
from policies.search.value import N_FEATURES


def test_a_fit_finds_the_weights_that_made_the_results() -> None:
    chance = np.random.default_rng(3)
    weights = np.array([1.5, -0.5, 0.0])
    features = chance.normal(size=(20_000, 3))
    points = (chance.random(20_000) < 1 / (1 + np.exp(-features @ weights))).astype(float)

    assert fit(features, points) == pytest.approx(weights, abs=0.1)


def test_states_of_matches_come_with_what_the_match_came_to() -> None:
    features, points, matches = collect(load_rules("paper"), "rush", "defend", 4, seed=1)

    assert features.shape == (len(points), N_FEATURES)
    assert set(matches) == {0, 1, 2, 3}
    assert set(points) <= {0.0, 0.5, 1.0}
    assert features[:, 4].mean() > 0.0, "who attacks is nearer to the flag than who stays at home"
