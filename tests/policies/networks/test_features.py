"""What the network sees: it is what the team knows, in a frame where nothing tells blue from red or west from east."""

from dataclasses import replace

import numpy as np
import pytest

from arena.envs.batched import BatchedEnv
from arena.game.observation import Observations
from arena.game.ruleset import load
from arena.game.types import FLAGS, HALVES, UAVS, UGVS, Action, Code, Team
from policies.networks.features import ONE, Encoded, Encoder, Plane, Scalar, mirror

PAPER = load("paper")
N_GAMES, N_TICKS = 12, 40


def swapped(ground: np.ndarray) -> np.ndarray:
    """Return codes with blue and red exchanged."""
    codes = np.arange(-1, len(Code) - 1, dtype=np.int8)
    for blue, red in (HALVES, FLAGS, UGVS, UAVS):
        codes[blue + 1], codes[red + 1] = red, blue
    return np.where((ground >= -1) & (ground <= 8), codes[np.clip(ground, -1, 8) + 1], ground).astype(np.int8)


def turned(seen: Observations) -> Observations:
    """Return what a team would see on the board's mirror image."""
    side = seen.side

    def cells(cell: np.ndarray) -> np.ndarray:
        return np.where(cell < 0, cell, cell + side - 1 - 2 * (cell % side)).astype(cell.dtype)

    ground = seen.ground.copy()
    ground[:, : side * side] = ground[:, : side * side].reshape(-1, side, side)[:, :, ::-1].reshape(len(ground), -1)
    return replace(seen, ground=ground, cell=cells(seen.cell), enemy_cell=cells(seen.enemy_cell))


def walk(n_ticks: int = N_TICKS) -> list[dict[Team, Observations]]:
    """Return what both teams see in matches of units that wander."""
    env, rng = BatchedEnv(PAPER, N_GAMES, seed=3), np.random.default_rng(0)
    seen = []
    for _ in range(n_ticks):
        seen.append({team: one.select(np.arange(N_GAMES)) for team, one in env.observe().items()})
        turn = env.step({team: rng.integers(0, 5, (N_GAMES, 6)).astype(np.int8) for team in Team})
        if turn.has_ended.any():
            break
    return seen


def copied(encoded: Encoded) -> Encoded:
    return Encoded(*(array.copy() for array in encoded))


@pytest.fixture(scope="module")
def matches() -> list[dict[Team, Observations]]:
    return walk()


def test_blue_and_red_see_alike_where_they_stand_alike(matches: list[dict[Team, Observations]]) -> None:
    blue, red = Encoder(PAPER, Team.BLUE, N_GAMES), Encoder(PAPER, Team.RED, N_GAMES)
    for seen in matches:
        mine = blue.encode(seen[Team.BLUE])
        theirs = red.encode(replace(seen[Team.BLUE], team=Team.RED, ground=swapped(seen[Team.BLUE].ground)))
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)


def test_the_enemys_half_is_always_in_the_east(matches: list[dict[Team, Observations]]) -> None:
    plain, other = Encoder(PAPER, Team.BLUE, N_GAMES), Encoder(PAPER, Team.BLUE, N_GAMES)
    for seen in matches:
        mine, theirs = plain.encode(seen[Team.BLUE]), other.encode(turned(seen[Team.BLUE]))
        for field in ("planes", "scalars", "cell", "alive", "legal"):
            np.testing.assert_array_equal(getattr(mine, field), getattr(theirs, field), field)
        assert (plain.is_turned != other.is_turned).all()
    assert plain.is_turned.any()
    assert not plain.is_turned.all()


def test_planes_show_the_units_where_the_frame_has_them(matches: list[dict[Team, Observations]]) -> None:
    encoder = Encoder(PAPER, Team.BLUE, N_GAMES)
    for seen in matches:
        encoded = encoder.encode(seen[Team.BLUE])
        for seat in range(N_GAMES):
            board = np.zeros((2, PAPER.side**2), int)
            for unit, cell in enumerate(encoded.cell[seat]):
                board[int(unit >= 4), cell] += ONE * int(encoded.alive[seat, unit])
            shown = encoded.planes[seat].reshape(-1, len(Plane))
            np.testing.assert_array_equal(shown[:, [Plane.OWN_UGV, Plane.OWN_UAV]].T, board)
            n_seen = (seen[Team.BLUE].enemy_cell[seat] >= 0).sum()
            assert shown[:, [Plane.ENEMY_UGV, Plane.ENEMY_UAV]].sum() == ONE * n_seen


def test_visible_is_what_is_in_sight_and_nothing_hidden_is_known_before_it_was_seen(
    matches: list[dict[Team, Observations]],
) -> None:
    encoder, was_seen = Encoder(PAPER, Team.BLUE, N_GAMES), np.zeros((N_GAMES, 20, 20), bool)
    for seen in matches:
        encoded = encoder.encode(seen[Team.BLUE])
        in_sight = seen[Team.BLUE].ground[:, :400].reshape(-1, 20, 20) != Code.HIDDEN
        in_sight = np.where(encoder.is_turned[:, None, None], in_sight[:, :, ::-1], in_sight)
        was_seen |= in_sight
        np.testing.assert_array_equal(encoded.planes[..., Plane.VISIBLE] > 0, in_sight)
        for plane in (Plane.OBSTACLE, Plane.OWN_FLAG, Plane.ENEMY_FLAG):
            assert not encoded.planes[..., plane][~was_seen].any()
        assert (encoded.planes[..., Plane.AGE][~was_seen] == 255).all()
        assert not encoded.planes[..., Plane.ENEMY_FLAG_MAY_BE][was_seen].any()


def test_legal_actions_are_those_of_the_observation_and_what_was_remembered(matches: list[dict[Team, Observations]]) -> None:
    encoder, remembered = Encoder(PAPER, Team.BLUE, N_GAMES), np.zeros((N_GAMES, 400), bool)
    n_refused = 0
    for seen in matches:
        blue = seen[Team.BLUE]
        legal = encoder.encode(blue).legal
        remembered |= blue.ground[:, :400] == Code.OBSTACLE
        for seat in range(N_GAMES):
            told = blue.seat(seat, PAPER)
            board = told.ground.copy()
            board[remembered[seat].reshape(20, 20)] = Code.OBSTACLE
            wanted = replace(told, ground=board).legal_actions
            mine = legal[seat].astype(bool)
            if encoder.is_turned[seat]:
                mine = mine[:, mirror(np.arange(5, dtype=np.int8))]
            np.testing.assert_array_equal(mine, wanted)
            n_refused += (~wanted).sum()
    assert n_refused > 0


def test_a_new_match_knows_nothing_of_the_last(matches: list[dict[Team, Observations]]) -> None:
    used, fresh = Encoder(PAPER, Team.BLUE, N_GAMES), Encoder(PAPER, Team.BLUE, N_GAMES)
    for seen in matches:
        used.encode(seen[Team.BLUE])
    used.start(np.arange(N_GAMES))
    for one, other in zip(used.encode(matches[0][Team.BLUE]), fresh.encode(matches[0][Team.BLUE]), strict=True):
        np.testing.assert_array_equal(one, other)


def test_seats_are_encoded_alike_alone_and_together(matches: list[dict[Team, Observations]]) -> None:
    together, alone = Encoder(PAPER, Team.BLUE, N_GAMES), Encoder(PAPER, Team.BLUE, 1)
    for seen in matches:
        whole, one = together.encode(seen[Team.BLUE]), alone.encode(seen[Team.BLUE].select([5]))
        for many, single in zip(whole, one, strict=True):
            np.testing.assert_array_equal(many[5], single[0])


def test_an_action_of_the_frame_moves_the_unit_as_the_frame_shows_it(matches: list[dict[Team, Observations]]) -> None:
    env, encoder = BatchedEnv(PAPER, N_GAMES, seed=3), Encoder(PAPER, Team.BLUE, N_GAMES)
    before = copied(encoder.encode(env.observe()[Team.BLUE]))
    east = np.full((N_GAMES, 6), Action.EAST, np.int8)
    env.step({Team.BLUE: encoder.to_board(east), Team.RED: np.zeros_like(east)})
    after = encoder.encode(env.observe()[Team.BLUE])
    moved = after.cell - before.cell
    assert moved[:, :4].min() >= 0
    assert moved[:, :4].max() == 1
    assert moved[:, 4:].max() == 3


@pytest.mark.parametrize("rules", [{"side": 16}, {"side": 28, "units": {"ugv": {"blue": 8, "red": 2}}}, {"fog": False}])
def test_other_boards_and_teams_are_encoded(rules: dict[str, object]) -> None:
    ruleset = PAPER.with_(rules)
    env = BatchedEnv(ruleset, 4, seed=1)
    encoded = Encoder(ruleset, Team.BLUE, 4).encode(env.observe()[Team.BLUE])

    assert encoded.planes.shape == (4, ruleset.side, ruleset.side, len(Plane))
    assert (encoded.scalars[:, Scalar.ENEMY_WALKERS] * 4 == sum(not unit.flies for unit in ruleset.team(Team.RED))).all()
