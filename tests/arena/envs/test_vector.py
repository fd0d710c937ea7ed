"""The vector form is told apart from Gymnasium's own, made of the single form, by its speed alone."""

from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from arena.envs.episodes import SteppedError
from arena.envs.vector import VectorCapture
from arena.errors import InputError, UnknownNameError
from arena.game.ruleset import load
from arena.game.types import Termination
from policies.environments import make_single, make_vector

SMALL = load("paper").with_({"side": 10, "tick_limit": 12})
N_ROWS = 3


def both(mode: AutoresetMode, **options: Any) -> tuple[VectorCapture, SyncVectorEnv[Any, Any]]:
    """Return our vector form, and Gymnasium's over as many single ones."""
    options |= {"opponent": "rush", "ruleset": SMALL}
    return make_vector(N_ROWS, autoreset_mode=mode, **options), SyncVectorEnv(
        [lambda: make_single(**options)] * N_ROWS, autoreset_mode=mode
    )


@pytest.mark.parametrize(("team", "layout"), [("blue", "dict"), ("red", "box")])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_it_gives_what_gymnasium_s_own_vector_form_gives(mode: AutoresetMode, team: str, layout: str) -> None:
    ours, theirs = both(mode, team=team, layout=layout, reward="outcome")
    rng, n_ended = np.random.default_rng(5), 0

    assert data_equivalence(ours.reset(seed=11), theirs.reset(seed=11), exact=True)
    for tick in range(40):
        if tick == 20:  # one row begins anew in the middle of its match
            mask = np.array([False, True, False])
            assert data_equivalence(
                ours.reset(options={"reset_mask": mask}), theirs.reset(options={"reset_mask": mask}), exact=True
            )
        actions = rng.integers(0, 5, (N_ROWS, 6))
        one, other = ours.step(actions), theirs.step(actions)
        assert data_equivalence(one, other, exact=True)
        assert one[0] in ours.observation_space
        n_ended += int(one[2].sum())
    assert n_ended >= 2 * N_ROWS
    assert ours.metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"] is mode


def test_without_autoreset_a_match_that_is_over_waits_for_its_reset() -> None:
    env, stay = make_vector(N_ROWS, opponent="rush", ruleset=SMALL, autoreset_mode="Disabled"), np.zeros((N_ROWS, 6), np.int8)
    env.reset(seed=1)
    over = np.zeros(N_ROWS, np.bool_)
    while not over.any():
        _, _, over, _, infos = env.step(stay)

    assert (infos["ending"][over] != Termination.RUNNING).all()
    with pytest.raises(SteppedError, match="reset them by a reset_mask"):
        env.step(stay)
    _, infos = env.reset(options={"reset_mask": over})
    assert (infos["_ending"] == over).all()
    assert (infos["ending"][over] == Termination.RUNNING).all()
    env.step(stay)


@pytest.mark.parametrize("mask", [[True] * 3, np.ones(2, np.bool_), np.ones(3, np.int8), np.zeros(3, np.bool_)])
def test_a_mask_that_fits_no_rows_is_refused_in_a_sentence(mask: Any) -> None:
    env = make_vector(N_ROWS, ruleset=SMALL)
    env.reset(seed=1)

    with pytest.raises(SteppedError, match="reset_mask must be an array of 3 truth values, one of them true"):
        env.reset(options={"reset_mask": mask})


def test_a_mask_before_the_first_reset_and_too_few_seeds_are_refused() -> None:
    env = make_vector(N_ROWS, ruleset=SMALL)

    with pytest.raises(SteppedError, match="without a reset_mask first"):
        env.reset(options={"reset_mask": np.array([True, False, False])})
    with pytest.raises(SteppedError, match="a seed for each of 3 rows, not 2"):
        env.reset(seed=[1, 2])


@pytest.mark.parametrize("seed", [np.int64(0), np.int64(3), (1, 2, 3), np.arange(3), 1.0])
def test_what_is_no_seed_is_refused_and_not_taken_for_none(seed: Any) -> None:
    with pytest.raises(SteppedError, match="seed must be an int, or a list with one for each of 3 rows, not "):
        make_vector(N_ROWS, ruleset=SMALL).reset(seed=seed)


@pytest.mark.parametrize("num_envs", [0, -2])
def test_no_rows_are_refused_in_a_sentence(num_envs: int) -> None:
    with pytest.raises(InputError, match=f"num_envs is {num_envs}; there must be at least one row"):
        make_vector(num_envs, ruleset=SMALL)


def test_a_mode_of_another_name_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'SameStep'"):
        make_vector(N_ROWS, ruleset=SMALL, autoreset_mode="samestep")
