"""A game is the same in whatever company it is played: on the default board's own path, alone or in a batch, in any row."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import SEEDS, bytes_of, copy_of, random_orders, rulesets, scatter

from arena.game.engine import BatchedGame
from arena.game.kernel import DEFAULT_SHAPE, observe, step
from arena.game.keys import MatchKeys
from arena.game.observation import FIELDS
from arena.game.ruleset import Ruleset, load
from arena.game.state import Rule
from arena.game.types import Team

DEFAULTS = ("paper", "gym-cap", "mirror")


def started(rules: Ruleset, n_games: int, first: int = 0) -> BatchedGame:
    games = BatchedGame(rules, n_games)
    keys = [
        MatchKeys(map_key=bytes([1, i % 256] * 16), match_key=bytes([2, i % 256] * 16)) for i in range(first, first + n_games)
    ]
    games.start(range(n_games), keys)
    return games


def seen(games: BatchedGame, special: bool, with_units: bool) -> bytes:
    boards = np.zeros((2, *games.state.ground.shape), np.int8)
    observe(games.state, games.tables, boards, np.zeros((2, games.ruleset.side + 2), np.uint64), with_units, special)
    return boards.tobytes()


@pytest.mark.parametrize("name", DEFAULTS)
@pytest.mark.parametrize("change", [{}, {"fog": False}, {"random_combat": False}, {"units": {"ugv": {"step": 0, "strength": 3}}}])
def test_the_path_for_the_default_board_is_the_general_one(
    name: str, change: dict[str, object], size: Callable[[int, int], int]
) -> None:
    rng = np.random.default_rng(3)
    fast = started(load(name).with_(change), size(64, 1024))
    for row in range(0, fast.n_games, 2):  # half of them crowded, so that there is something to settle
        scatter(fast, row, rng, n_obstacles=int(rng.integers(300, 380)))
    slow = copy_of(fast)
    shape = (Rule.SIDE, Rule.BLUE_UNITS, Rule.BLUE_WALKERS, Rule.RED_UNITS, Rule.RED_WALKERS)
    assert tuple(fast.tables.rule[list(shape)]) == DEFAULT_SHAPE
    for _ in range(fast.ruleset.tick_limit):
        orders = random_orders(rng, fast)
        step(fast.state, orders, fast.tables, np.zeros((4, 32), np.int64), True)
        step(slow.state, orders, slow.tables, np.zeros((4, 32), np.int64), False)
        assert bytes_of(fast) == bytes_of(slow)
        assert all(seen(fast, True, units) == seen(slow, False, units) for units in (True, False))
    assert (fast.state.field[:, 0] > 0).all()


@given(rulesets(max_side=20), SEEDS, st.integers(1, 12))
def test_neither_the_batch_nor_the_place_in_it_matters(rules: Ruleset, seed: int, n_games: int) -> None:
    rng = np.random.default_rng(seed)
    games = BatchedGame(rules, n_games)
    for row in range(n_games):
        scatter(games, row, rng)
    places = rng.permutation(n_games)
    shuffled = copy_of(games, places)
    alone = [copy_of(games, [row]) for row in range(n_games)]
    for _ in range(6):
        orders = random_orders(rng, games)
        games.step(orders)
        shuffled.step(orders[places])
        for row, single in enumerate(alone):
            single.step(orders[row : row + 1])
            assert all((one[0] == many[row]).all() for one, many in zip(single.state, games.state, strict=True))
        assert all((one == many[places]).all() for one, many in zip(shuffled.state, games.state, strict=True))
        assert (shuffled.grids() == games.grids()[:, places]).all()
        mine, theirs = shuffled.observe(), games.observe()
        for team in Team:
            for name in FIELDS:
                assert (getattr(mine[team], name) == getattr(theirs[team], name)[places]).all(), name


@pytest.mark.parametrize("name", ["paper", "mirror"])
def test_a_board_does_not_depend_on_the_boards_beside_it(name: str) -> None:
    together = started(load(name), 16)
    for row in range(16):
        alone = started(load(name), 1, first=row)
        assert all((one[0] == many[row]).all() for one, many in zip(alone.state, together.state, strict=True))


def test_a_game_that_is_over_does_not_move() -> None:
    games = started(load("paper"), 8)
    rng = np.random.default_rng(0)
    for _ in range(games.ruleset.tick_limit):
        games.step(random_orders(rng, games))
    assert games.is_over.all()
    before = bytes_of(games)

    games.step(random_orders(rng, games))

    assert bytes_of(games) == before


def test_a_row_is_over_until_it_is_started() -> None:
    games = BatchedGame(load("paper"), 3)
    games.start([1], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])

    assert games.is_over.tolist() == [True, False, True]


def test_starting_a_row_again_leaves_the_others_alone_and_nothing_behind() -> None:
    games = started(load("paper"), 3)
    rng = np.random.default_rng(1)
    for _ in range(20):
        games.step(random_orders(rng, games))
    before = copy_of(games)

    games.start([1], [MatchKeys(map_key=bytes([1, 9] * 16), match_key=bytes([2, 9] * 16))])

    fresh = started(load("paper"), 1, first=9)
    for now, was, new in zip(games.state, before.state, fresh.state, strict=True):
        assert (now[[0, 2]] == was[[0, 2]]).all()
        assert (now[1] == new[0]).all()


@pytest.mark.parametrize(("shape", "kind"), [((2, 11), np.int8), ((1, 12), np.int8), ((2, 12), np.int64), ((24,), np.int8)])
def test_orders_of_another_shape_are_the_callers_fault(shape: tuple[int, ...], kind: type) -> None:
    with pytest.raises(ValueError, match=r"orders must be int8 of shape \(2, 12\)"):
        started(load("paper"), 2).step(np.zeros(shape, kind))
