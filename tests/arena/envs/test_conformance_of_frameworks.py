"""Frameworks take the environments: their own checks pass, and where they have a vector form of their own, ours equals it.

A framework that is not installed is skipped, and fails where ARENA_REQUIRE_ALL=1 promises that nothing is skipped.
"""

import os
import warnings
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from pettingzoo.test import parallel_api_test

from arena.envs import parallel_env
from arena.errors import InputError
from arena.game.ruleset import load
from policies.environments import make_sb3, make_single, make_vector

SMALL = load("paper").with_({"side": 10, "tick_limit": 12})


def needs(package: str) -> None:
    if find_spec(package) is None:
        (pytest.fail if os.environ.get("ARENA_REQUIRE_ALL") == "1" else pytest.skip)(f"{package} is not installed")


@pytest.fixture
def sb3() -> Any:
    needs("stable_baselines3")
    import stable_baselines3

    return stable_baselines3


@pytest.fixture
def torchrl() -> Any:
    needs("torchrl")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torchrl's own imports
        import torchrl.envs

    return torchrl


@pytest.fixture
def supersuit() -> Any:
    needs("supersuit")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import supersuit

    return supersuit


@pytest.mark.parametrize("layout", ["dict", "box"])
def test_stable_baselines_s_own_test_passes(sb3: Any, layout: str) -> None:
    from stable_baselines3.common.env_checker import check_env

    check_env(make_single("rush", ruleset=SMALL, layout=layout), warn=False)


@pytest.mark.parametrize("layout", ["dict", "box"])
def test_the_vec_env_gives_what_stable_baselines_s_own_gives(sb3: Any, layout: str) -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    options: dict[str, Any] = {"opponent": "rush", "ruleset": SMALL, "layout": layout}
    ours, theirs = make_sb3(3, **options), DummyVecEnv([lambda: make_single(**options)] * 3)
    rng, n_ended = np.random.default_rng(5), 0
    for env in (ours, theirs):
        env.seed(7)
    assert data_equivalence(ours.reset(), dict(theirs.reset()) if layout == "dict" else theirs.reset(), exact=True)
    assert ours.reset_infos == theirs.reset_infos
    for _ in range(30):
        actions = rng.integers(0, 5, (3, 6))
        one, other = ours.step(actions), theirs.step(actions)
        seen = dict(other[0]) if layout == "dict" else other[0]
        assert data_equivalence(one, (seen, *other[1:]), exact=True)
        assert ours.reset_infos == theirs.reset_infos
        n_ended += int(one[2].sum())
    assert n_ended >= 3
    assert ours.observation_space == theirs.observation_space
    assert ours.get_attr("render_mode") == theirs.get_attr("render_mode")
    assert ours.env_is_wrapped(object) == [False] * 3


def test_what_rows_of_a_batch_cannot_do_is_said(sb3: Any) -> None:
    env = make_sb3(2, ruleset=SMALL)
    for call in (lambda: env.set_attr("reward", "outcome"), lambda: env.env_method("render")):
        with pytest.raises(InputError, match="the rows of a batch have no"):
            call()
    with pytest.raises(InputError, match="SameStep"):
        type(env)(make_vector(2, ruleset=SMALL))


@pytest.mark.parametrize("layout", ["dict", "box"])
def test_torchrl_s_own_test_passes_for_each_form(torchrl: Any, layout: str) -> None:
    from torchrl.envs import GymWrapper, PettingZooWrapper, check_env_specs

    options: dict[str, Any] = {"ruleset": SMALL, "layout": layout}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it was tried with another version of PettingZoo
        for env in (
            GymWrapper(make_single("rush", **options)),
            GymWrapper(make_vector(2, opponent="rush", autoreset_mode="SameStep", **options)),
            GymWrapper(make_vector(2, opponent="rush", autoreset_mode="Disabled", **options)),
            PettingZooWrapper(parallel_env(agents="teams", **options)),
            PettingZooWrapper(parallel_env(agents="units", **options), use_mask=True),
        ):
            check_env_specs(env)
            n_ticks = env.rollout(30, break_when_any_done=False).shape[-1]
            assert n_ticks == 30, "matches follow one another"


def test_with_supersuit_the_fallen_stay_and_pettingzoo_s_own_test_passes(supersuit: Any) -> None:
    env = supersuit.black_death_v3(parallel_env(SMALL, "units", layout="box"))
    parallel_api_test(env, num_cycles=60)


def test_supersuit_makes_a_vector_form_of_it_that_plays_match_after_match(supersuit: Any) -> None:
    alone = supersuit.black_death_v3(parallel_env(SMALL, "units", layout="box"))
    env = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(alone), 2, base_class="gymnasium")
    seen, _ = env.reset(seed=1)
    rng, n_ended = np.random.default_rng(3), 0
    for _ in range(40):
        assert all(row in env.observation_space for row in seen)
        seen, _, over, cut, _ = env.step(rng.integers(0, 5, 24))
        n_ended += int((over | cut).any())
    assert n_ended >= 2
