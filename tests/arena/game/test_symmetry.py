"""No colour and no direction is better than another: exchange the teams, or turn the board, and the game is the mirror image."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from worlds import SEEDS, facts_of, random_orders, rulesets, scatter

from arena.game.engine import BatchedGame
from arena.game.observation import FIELDS
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Code, Team

EXCHANGED = np.array([1, 0, 4, 5, 2, 3, 7, 6, 8, -1], np.int8)
"""Code of the other team, by code; the last is HIDDEN, -1."""


def exchanged_rules(rules: Ruleset) -> Ruleset:
    return replace(rules, units=tuple(replace(unit, blue=unit.red, red=unit.blue) for unit in rules.units))


def swap(units: NDArray[np.generic], n_blue: int) -> NDArray[np.generic]:
    """Put the red units first."""
    return np.concatenate([units[:, n_blue:], units[:, :n_blue]], axis=1)


def exchange(games: BatchedGame) -> BatchedGame:
    """Return the same games with the teams exchanged."""
    twin, n_blue = BatchedGame(exchanged_rules(games.ruleset), games.n_games), games.n_units[Team.BLUE]
    mine, theirs = games.state, twin.state
    theirs.ground[:] = EXCHANGED[mine.ground]
    theirs.cell[:], theirs.alive[:] = swap(mine.cell, n_blue), swap(mine.alive, n_blue)
    theirs.key[:] = mine.key[:, :, ::-1]
    theirs.field[:] = mine.field
    for one, other in ((StateField.BLUE_FLAG, StateField.RED_FLAG), (StateField.BLUE_LIVING, StateField.RED_LIVING)):
        theirs.field[:, [one, other]] = mine.field[:, [other, one]]
    theirs.field[:, StateField.SCORE] = -mine.field[:, StateField.SCORE]
    twin._seat_keys[:] = games._seat_keys[::-1]
    return twin


def assert_exchanged(one: BatchedGame, other: BatchedGame) -> None:
    for row in range(one.n_games):
        mine, theirs = facts_of(one, row), facts_of(other, row)
        n_blue = one.n_units[Team.BLUE]
        assert theirs["cells"] == mine["cells"][n_blue:] + mine["cells"][:n_blue]
        assert theirs["alive"] == mine["alive"][n_blue:] + mine["alive"][:n_blue]
        assert theirs["living"] == mine["living"][::-1]
        assert theirs["score"] == -mine["score"]
        assert theirs["winner"] == {-1: -1, 0: 1, 1: 0}[mine["winner"]]
        assert (theirs["tick"], theirs["ending"]) == (mine["tick"], mine["ending"])


def assert_same_view(one: BatchedGame, other: BatchedGame) -> None:
    """What blue sees here, red sees there."""
    assert (EXCHANGED[one.grids()] == other.grids()[::-1]).all()
    n_cells = one.ruleset.side**2
    mine, theirs = one.observe(), other.observe()
    for team in Team:
        here, there = mine[team], theirs[team.other]
        assert (EXCHANGED[here.ground[:, :n_cells]] == there.ground[:, :n_cells]).all()
        for name in FIELDS.keys() - {"ground"}:
            assert (getattr(here, name) == getattr(there, name)).all(), name


@given(rulesets(max_side=24), SEEDS)
def test_exchanged_teams_play_the_mirrored_game(rules: Ruleset, seed: int) -> None:
    rng = np.random.default_rng(seed)
    games = BatchedGame(rules, 3)
    for row in range(games.n_games):
        scatter(games, row, rng)
    games._seat_keys[:] = rng.integers(0, 2**32, games._seat_keys.shape)
    twin = exchange(games)
    assert_same_view(games, twin)
    while not games.is_over.all():
        orders = random_orders(rng, games)
        games.step(orders)
        twin.step(swap(orders, games.n_units[Team.BLUE]).astype(np.int8))
        assert_exchanged(games, twin)
    assert_same_view(games, twin)


@given(rulesets(max_side=24), SEEDS, st.sampled_from(["turned", "upside down", "left to right", "transposed"]))
def test_the_board_has_no_preferred_direction(rules: Ruleset, seed: int, way: str) -> None:
    rng = np.random.default_rng(seed)
    games = BatchedGame(rules, 3)
    for row in range(games.n_games):
        scatter(games, row, rng)
    side = rules.side
    rows, columns = np.divmod(np.arange(side * side), side)
    image, action = {
        "turned": ((side - 1 - rows) * side + side - 1 - columns, [0, 3, 4, 1, 2]),
        "upside down": ((side - 1 - rows) * side + columns, [0, 3, 2, 1, 4]),
        "left to right": (rows * side + side - 1 - columns, [0, 1, 4, 3, 2]),
        "transposed": (columns * side + rows, [0, 4, 3, 2, 1]),
    }[way]
    twin = BatchedGame(rules, games.n_games)
    for mine, theirs in zip(games.state, twin.state, strict=True):
        theirs[:] = mine
    twin.state.ground[:, image] = games.state.ground[:, : side * side]
    twin.state.field[:, [StateField.BLUE_FLAG, StateField.RED_FLAG]] = image[
        games.state.field[:, [StateField.BLUE_FLAG, StateField.RED_FLAG]]
    ]
    twin.state.cell[:] = image[games.state.cell]
    for _ in range(10):
        orders = rng.integers(0, 5, games.state.cell.shape, dtype=np.int8)
        games.step(orders)
        twin.step(np.array(action, np.int8)[orders])
        assert (twin.state.cell == image[games.state.cell]).all()
        assert (twin.state.alive == games.state.alive).all()
        facts = [
            StateField.TICK,
            StateField.ENDING,
            StateField.WINNER,
            StateField.SCORE,
            StateField.BLUE_LIVING,
            StateField.RED_LIVING,
        ]
        assert (twin.state.field[:, facts] == games.state.field[:, facts]).all()
    grids = games.grids().reshape(2, games.n_games, -1)
    assert (twin.grids().reshape(2, games.n_games, -1)[:, :, image] == grids).all()


def test_the_table_of_exchanged_codes_is_its_own_inverse() -> None:
    codes = np.arange(-1, 9)

    assert (EXCHANGED[EXCHANGED[codes]] == codes).all()
    assert EXCHANGED[Code.HIDDEN] == Code.HIDDEN
    assert EXCHANGED[Code.BLUE_UAV] == Code.RED_UAV
