"""The network that values plans: nothing but the plan, the board and the enemy's model counts, and that as it should."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from arena.envs.batched import BatchedEnv
from arena.errors import PolicyError
from arena.game.ruleset import load
from arena.game.types import Team
from policies.networks.appraisal import Appraisal
from policies.networks.appraiser import Appraiser, AppraiserShape
from policies.networks.checkpoint import build_network, check_size, describe, load_checkpoint, save_checkpoint, shape_of
from policies.networks.features import UPSIDE_DOWN, Encoded, Encoder, upside_down
from policies.registry import load as load_fighter

PAPER = load("paper")
SHAPE = AppraiserShape(channels=8, blocks=1, patch=5, local=8, hidden=16, roles=4, models=3)
N_SEATS, N_PLANS, N_UNITS, N_WALKERS = 3, 5, 6, 4


def network() -> Appraiser:
    torch.manual_seed(0)
    made = Appraiser(SHAPE)
    for parameter in made.parameters():
        torch.nn.init.normal_(parameter, std=0.2)  # at its start a block is the identity, which would hide much
    return made.eval()


def encoded() -> Encoded:
    seen = Encoder(PAPER, Team.BLUE, N_SEATS).encode(BatchedEnv(PAPER, N_SEATS, seed=1).observe()[Team.BLUE])
    return Encoded(*(array.copy() for array in seen))


def plans(seed: int = 0) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 4, (N_SEATS, N_PLANS, N_UNITS)), rng.integers(-1, 5, (N_SEATS, N_PLANS, N_UNITS))


def likely(seed: int = 0) -> NDArray[np.float32]:
    return np.random.default_rng(seed).dirichlet(np.ones(3), N_SEATS).astype(np.float32)


def appraise(seen: Encoded, models: NDArray[np.float32], *, is_mirrored: bool = False) -> Appraisal:
    return appraise_by(network(), seen, models, is_mirrored=is_mirrored)


def appraise_by(made: Appraiser, seen: Encoded, models: NDArray[np.float32], *, is_mirrored: bool = False) -> Appraisal:
    appraisal = Appraisal(made, N_WALKERS, is_mirrored=is_mirrored)
    appraisal.look(seen, models)
    return appraisal


def test_a_plan_is_played_for_what_it_was_learned_to_be_worth() -> None:
    made, seen, (role, first), models = network(), encoded(), plans(), likely()
    seen.alive[1, 2] = 0
    arrays = (seen.planes, seen.scalars, seen.cell, seen.alive, models)
    with torch.inference_mode():
        outlook = made.look(*map(torch.from_numpy, arrays), N_WALKERS)
        learned = made.appraise(outlook, torch.from_numpy(role), torch.from_numpy(first), N_WALKERS).numpy()

    assert learned.std() > 0.1
    np.testing.assert_allclose(appraise_by(made, seen, models).logits(role, first), learned, rtol=1e-4, atol=1e-5)


def test_what_each_unit_does_and_who_the_enemy_is_counts() -> None:
    seen, (role, first) = encoded(), plans()
    before = appraise(seen, likely()).logits(role, first)

    for unit in range(N_UNITS):
        other_role, other_first = role.copy(), first.copy()
        other_role[..., unit], other_first[..., unit] = (role[..., unit] + 1) % 4, (first[..., unit] + 2) % 6 - 1
        assert (np.abs(appraise(seen, likely()).logits(other_role, first) - before) > 1e-5).all()
        assert (np.abs(appraise(seen, likely()).logits(role, other_first) - before) > 1e-5).all()
    assert (np.abs(appraise(seen, likely(1)).logits(role, first) - before) > 1e-5).all()


def test_what_the_fallen_would_do_does_not_count() -> None:
    seen, (role, first) = encoded(), plans()
    seen.alive[1, 2] = 0
    other = role.copy()
    other[:, :, 2] = (role[:, :, 2] + 1) % 4
    change = np.abs(appraise(seen, likely()).logits(other, first) - appraise(seen, likely()).logits(role, first))

    assert not change[1].any()
    assert (change[[0, 2]] > 1e-5).all()


def test_who_else_is_in_the_batch_and_which_other_plans_there_are_does_not_count() -> None:
    seen, (role, first), models = encoded(), plans(), likely()
    alone = Encoded(*(array[1:2] for array in seen))
    whole = appraise(seen, models).logits(role, first)

    np.testing.assert_allclose(
        appraise(alone, models[1:2]).logits(role[1:2, 3:], first[1:2, 3:]), whole[1:2, 3:], rtol=1e-4, atol=1e-4
    )


def test_with_the_mirror_a_plan_is_worth_the_same_on_a_board_turned_upside_down() -> None:
    seen, (role, first), models = encoded(), plans(), likely()
    turned = np.where(first < 0, first, UPSIDE_DOWN[first])
    both, other = (appraise(one, models, is_mirrored=True) for one in (seen, upside_down(seen)))
    plain = [appraise(seen, models).logits(role, first), appraise(upside_down(seen), models).logits(role, turned)]

    np.testing.assert_allclose(both.logits(role, first), other.logits(role, turned), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(both.logits(role, first), (plain[0] + plain[1]) / 2, rtol=1e-4, atol=1e-4)
    assert np.abs(plain[0] - plain[1]).max() > 1e-3


def test_a_checkpoint_gives_back_the_same_network_and_one_of_other_roles_is_no_fighter(tmp_path: Path) -> None:
    made, (role, first), seen = network(), plans(), encoded()
    kind, shape = shape_of(made)
    path = tmp_path / "one.safetensors"
    save_checkpoint(path, made.state_dict(), describe(made, PAPER, {}))
    again = load_checkpoint(path).network

    assert kind == "appraiser"
    assert isinstance(again, Appraiser)
    assert isinstance(build_network(kind, shape), Appraiser)
    np.testing.assert_allclose(
        appraise_by(again, seen, likely()).logits(role, first),
        appraise(seen, likely()).logits(role, first),
        rtol=1e-4,
    )
    with pytest.raises(PolicyError, match=r"knows 4 roles and 3 models of the enemy; this arena has 14 and 11$"):
        load_fighter(str(path))


@pytest.mark.parametrize("change", [{"roles": 0}, {"roles": None}, {"patch": 4}, {"planes": 3}])
def test_sizes_that_no_appraiser_has_are_refused(change: dict[str, int | None]) -> None:
    _, shape = shape_of(network())
    sizes = {name: size for name, size in {**shape, **change}.items() if size is not None}

    with pytest.raises(ValueError, match="no network of the kind appraiser has the sizes"):
        build_network("appraiser", sizes)


def test_an_appraiser_that_no_checkpoint_can_hold_is_refused_before_it_is_made() -> None:
    check_size(SHAPE)
    with pytest.raises(Exception, match="channels=400 and blocks=1 would take"):
        check_size(replace(SHAPE, channels=400))
