import numpy as np
import pytest

from arena.game.ruleset import load as load_rules
from benchmarks.measuring.luck import play_again, share_of_map


def test_what_chance_and_what_the_map_decides_are_told_apart() -> None:
    chance = np.random.default_rng(5)
    by_chance = (chance.random((2000, 8)) < 0.7).astype(float)
    by_map = np.repeat((chance.random((2000, 1)) < 0.7).astype(float), 8, axis=1)
    half = (chance.random((2000, 8)) < np.where(chance.random((2000, 1)) < 0.5, 0.1, 0.9)).astype(float)

    assert share_of_map(by_chance) == pytest.approx(0.0, abs=0.02)
    assert share_of_map(by_map) == 1.0
    assert share_of_map(half) == pytest.approx(0.16 / 0.25, abs=0.04)


def test_replays_share_their_map_and_nothing_else() -> None:
    ruleset = load_rules("paper")

    points = play_again(ruleset, "rush", "random", n_maps=6, n_replays=4)

    assert points.shape == (12, 4)
    assert set(points.ravel()) <= {0.0, 0.5, 1.0}
    assert points.mean() > 0.6, "rush beats random from either side"
    assert (points != points[:, :1]).any(), "fights differ from replay to replay"
