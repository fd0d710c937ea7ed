"""The networks: sizes of the paper, any number of units, any board, and nothing that depends on who else is in the batch."""

import numpy as np
import pytest
import torch

from arena.envs.batched import BatchedEnv
from arena.game.ruleset import Ruleset, load
from arena.game.types import Code, Team
from policies.networks.features import N_PLANES, N_SCALARS, Encoder
from policies.networks.judges import N_ENEMY_PLANES, N_TRUTH_PLANES, Critic, Locator
from policies.networks.learned import choose, infer
from policies.networks.models import PaperNetwork, TeamNetwork, TeamShape, planes_around

PAPER = load("paper")
SMALL = TeamShape(channels=8, blocks=1, patch=5, local=8, hidden=16)


def network() -> TeamNetwork:
    torch.manual_seed(0)
    made = TeamNetwork(SMALL)
    for parameter in made.parameters():
        torch.nn.init.normal_(parameter, std=0.1)  # at its start a block is the identity, which would hide much
    return made


def encoded(ruleset: Ruleset, n_games: int) -> tuple[torch.Tensor, ...]:
    one = Encoder(ruleset, Team.BLUE, n_games).encode(BatchedEnv(ruleset, n_games, seed=1).observe()[Team.BLUE])
    return tuple(torch.from_numpy(array) for array in (one.planes, one.scalars, one.cell, one.legal))


def test_the_papers_network_has_the_sizes_of_table_5() -> None:
    made = PaperNetwork()
    shapes = {name: tuple(one.shape) for name, one in made.named_parameters() if name.endswith("weight")}

    assert shapes == {
        "first.weight": (32, 1, 5, 5),
        "second.weight": (32, 32, 3, 3),
        "dense.weight": (400, 6272),
        "out.weight": (5, 400),
    }
    assert made(torch.zeros(3, 20, 20, dtype=torch.int8)).shape == (3, 5)


def test_a_plane_for_each_code_shows_what_the_raw_codes_show() -> None:
    made = PaperNetwork(planes=len(Code))
    for parameter in made.parameters():
        torch.nn.init.zeros_(parameter)
    with torch.no_grad():
        made.first.weight[0, Code.RED_FLAG + 1] = 1.0  # sees a flag, and nothing else
    views = torch.full((2, 20, 20), int(Code.OBSTACLE), dtype=torch.int8)
    views[1, 4, 9] = Code.RED_FLAG
    seen: list[torch.Tensor] = []
    made.first.register_forward_hook(lambda *told: seen.append(told[2].detach()))
    made(views)

    assert not seen[0][0].any()
    assert seen[0][1, 0].sum() == 25
    assert seen[0][1, 0, 0:5, 5:10].all()


def test_signed_planes_are_1_for_own_and_minus_1_for_the_enemy() -> None:
    made = PaperNetwork(window=7, planes=6)
    views = torch.full((1, 7, 7), int(Code.HIDDEN), dtype=torch.int8)
    views[0, 0] = torch.tensor([Code.BLUE_HALF, Code.RED_HALF, Code.BLUE_UGV, Code.RED_UGV, Code.BLUE_UAV, Code.RED_UAV, 8])
    views[0, 1, :2] = torch.tensor([Code.BLUE_FLAG, Code.RED_FLAG])
    seen: list[torch.Tensor] = []
    made.first.register_forward_pre_hook(lambda *told: seen.append(told[1][0]))

    made(views)

    hidden, ground, ugv, uav, flag, obstacle = seen[0][0].tolist()
    nothing = [0.0] * 7
    assert ground[0] == [1, -1, 0, 0, 0, 0, 0]
    assert ugv[0] == [0, 0, 1, -1, 0, 0, 0]
    assert uav[0] == [0, 0, 0, 0, 1, -1, 0]
    assert flag[:2] == [nothing, [1, -1, 0, 0, 0, 0, 0]]
    assert obstacle[:2] == [[0, 0, 0, 0, 0, 0, 1], nothing]
    assert hidden == [nothing, [0, 0, 1, 1, 1, 1, 1], *[[1.0] * 7] * 5]
    assert "signs" not in made.state_dict()


@pytest.mark.parametrize(("side", "n_ugv", "n_uav"), [(20, 4, 2), (16, 1, 0), (28, 8, 2), (20, 0, 3)])
def test_the_team_network_takes_any_board_and_team(side: int, n_ugv: int, n_uav: int) -> None:
    units = {"ugv": {"blue": n_ugv, "red": n_ugv}, "uav": {"blue": n_uav, "red": n_uav}}
    logits = network()(*encoded(PAPER.with_({"side": side, "units": units}), 3), n_ugv)

    assert logits.shape == (3, n_ugv + n_uav, 5)
    assert torch.isfinite(logits).all()


def test_each_seat_is_judged_by_itself() -> None:
    made, inputs = network(), encoded(PAPER, 6)

    together = made(*inputs, 4)
    alone = made(*(one[2:3] for one in inputs), 4)

    torch.testing.assert_close(together[2:3], alone, rtol=1e-4, atol=1e-5)
    assert not torch.allclose(together[2], together[3])


def test_what_a_unit_does_depends_on_its_own_place_and_index() -> None:
    made, (planes, scalars, cell, legal) = network(), encoded(PAPER, 1)
    everywhere = torch.ones_like(legal)
    here = cell.clone()
    here[:, 1] = here[:, 0]
    there = here.clone()
    there[:, 1] = (here[:, 0] + 7 * 20 + 3) % 400

    together, apart = made(planes, scalars, here, everywhere, 4), made(planes, scalars, there, everywhere, 4)

    assert not torch.allclose(together[0, 0], together[0, 1])  # by index alone
    torch.testing.assert_close(together[0, 0], apart[0, 0])
    assert not torch.allclose(together[0, 1], apart[0, 1])


def test_distances_near_a_unit_are_differences_in_steps() -> None:
    planes, _, cell, _ = encoded(PAPER, 2)
    values = planes.float() / 32
    size, middle = SMALL.patch, SMALL.patch // 2

    near = planes_around(values, cell, size).view(2, 6, size, size, N_PLANES)

    for seat in range(2):
        for unit in range(4):
            row, column = divmod(int(cell[seat, unit]), 20)
            assert near[seat, unit, middle, middle, 17] == 0
            if column > 0:
                step = (values[seat, row, column - 1, 17] - values[seat, row, column, 17]) * 8
                assert near[seat, unit, middle, middle - 1, 17] == step.clamp(-4, 4)
                assert near[seat, unit, middle, middle - 1, 1] == values[seat, row, column - 1, 1]


def test_what_is_not_legal_is_never_chosen() -> None:
    logits = torch.full((500, 6, 5), -1e4)
    logits[:, :, 3] = 0.0
    actions = np.zeros((500, 6), np.int8)

    choose(logits.numpy(), np.arange(500, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15), actions)

    assert (actions == 3).all()


def test_actions_are_drawn_as_often_as_their_chances_say() -> None:
    chances = np.array([0.5, 0.0, 0.2, 0.25, 0.05])
    logits = np.tile(np.log(np.maximum(chances, 1e-9)).astype(np.float32), (20_000, 2, 1))
    actions = np.zeros((20_000, 2), np.int8)

    choose(logits, np.arange(20_000, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15), actions)

    for unit in range(2):
        np.testing.assert_allclose(np.bincount(actions[:, unit], minlength=5) / 20_000, chances, atol=0.015)
    assert (actions[:, 0] != actions[:, 1]).any()


def test_chunks_make_no_difference() -> None:
    made = network().eval()
    one = Encoder(PAPER, Team.BLUE, 150).encode(BatchedEnv(PAPER, 150, seed=1).observe()[Team.BLUE])
    whole = made(*(torch.from_numpy(array) for array in (one.planes, one.scalars, one.cell, one.legal)), 4)

    np.testing.assert_allclose(infer(made, one, 4), whole.detach().numpy(), rtol=1e-4, atol=1e-5)


def test_the_critic_sees_the_truth() -> None:
    torch.manual_seed(0)
    critic = Critic(channels=8, blocks=1)
    planes, scalars = torch.zeros(2, 20, 20, N_PLANES, dtype=torch.uint8), torch.zeros(2, N_SCALARS)
    truth = torch.zeros(2, 20, 20, N_TRUTH_PLANES, dtype=torch.uint8)
    truth[1, 3, 4, 0] = 32

    values = critic(planes, truth, scalars)

    assert values.shape == (2,)
    assert values[0] != values[1]


def test_the_locator_tells_the_four_cells_of_a_block_apart() -> None:
    locator = Locator(SMALL)
    for parameter in locator.parameters():
        torch.nn.init.zeros_(parameter)
    board = torch.zeros(1, SMALL.channels, 10, 10)
    board[0, 0, 2, 3] = 1.0  # rows 4 and 5, columns 6 and 7
    with torch.no_grad():
        locator.out.weight[:, 0, 0, 0] = torch.arange(1.0, 1 + 4 * N_ENEMY_PLANES)
    logits = locator(board).view(20, 20, N_ENEMY_PLANES)

    assert logits[4:6, 6:8].flatten().tolist() == list(range(1, 1 + 4 * N_ENEMY_PLANES))
    assert logits.count_nonzero() == 4 * N_ENEMY_PLANES
