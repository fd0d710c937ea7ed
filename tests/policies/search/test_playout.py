"""Playouts keep the rules, know the ways, and value a world for one side as they do not for the other."""

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from quick import begin_games
from worlds import copy_of

from arena.game.engine import BatchedGame
from arena.game.ruleset import Ruleset, load
from arena.game.state import StateField
from arena.game.types import Action, Code, Team
from policies.belief.belief import make_belief
from policies.search.desk import set_posts
from policies.search.models import ATTACK, GO, MODELS, SCOUT
from policies.search.plans import Plans, make_plans
from policies.search.playout import Bench, make_bench, play_out
from policies.search.ways import NO_WAY, Ways, find_ways, make_ways

PAPER = load("paper")
N_WORLDS = 11
TICKS = 30
RULES = {
    "paper": PAPER,
    "gym-cap": load("gym-cap"),
    "certain combat": PAPER.with_({"random_combat": False, "self_counts": False, "attack_at_range": False}),
    "unequal teams": PAPER.with_({"units": {"ugv": {"blue": 6, "red": 3}, "uav": {"blue": 0, "red": 2}}}),
    "strong and slow": PAPER.with_({"units": {"tank": {"step": 0, "sight": 2, "attack": 3, "strength": 5, "blue": 1, "red": 2}}}),
}


def walkable_of(ground: np.ndarray, side: int) -> np.ndarray:
    """Return a board's open cells as rows of bits."""
    is_open = (ground[: side * side] != Code.OBSTACLE).reshape(side, side)
    return (is_open * (np.uint64(1) << np.arange(side, dtype=np.uint64))).sum(axis=1, dtype=np.uint64)


def bench_of(games: BatchedGame) -> Bench:
    """Return a bench whose worlds are games, on the board of the first, each with another model of the enemy."""
    ruleset, rng = games.ruleset, np.random.default_rng(1)
    bench = make_bench(ruleset, games.n_games)
    for mine, theirs in zip(bench.now.state, games.state, strict=True):
        mine[:] = theirs
    belief = make_belief(ruleset, Team.BLUE, 1)
    belief.walkable[0] = walkable_of(games.state.ground[0], ruleset.side)
    find_ways(belief, ruleset.side, bench.tables, bench.ways)
    forward = 1 if games.state.field[0, StateField.BLUE_FLAG] % ruleset.side < ruleset.side // 2 else -1
    set_posts(bench.desk, ruleset, Team.BLUE, forward)
    bench.now.model[:] = rng.integers(len(MODELS), size=bench.now.model.shape)
    bench.now.knows[:] = rng.integers(2, size=bench.now.knows.shape)
    return bench


def games_on_one_board(ruleset: Ruleset, n_games: int, seed: int = 0) -> BatchedGame:
    """Return games on one board, each with a chance of its own."""
    games = copy_of(begin_games(ruleset, [seed]), np.zeros(n_games, np.intp))
    games.state.key[:] = np.random.default_rng(seed).integers(0, 2**32, games.state.key.shape, dtype=np.uint32)
    return games


def bring_together(games: BatchedGame) -> None:
    """Put all units in the middle columns, where they fight whatever they are ordered."""
    side, rng = games.ruleset.side, np.random.default_rng(2)
    cells = np.arange(side**2)
    near = cells[(np.abs(cells % side - side / 2) < 4) & (games.state.ground[0, : side**2] != Code.OBSTACLE)]
    for world in range(games.n_games):
        games.state.cell[world] = rng.choice(near, games.state.cell.shape[1], replace=False)


def plans_of(ruleset: Ruleset, team: Team) -> Plans:
    """Return a plan that all attack, and one in which each unit has an order and a goal."""
    units = ruleset.team(team)
    plans = make_plans(2, len(units), N_WORLDS)
    for number, unit in enumerate(units):
        plans.role[:, number] = SCOUT if unit.flies else ATTACK, GO
        plans.first[1, number], plans.goal[1, number] = number % len(Action), 7 * number
    return plans


@pytest.mark.parametrize("plan", [0, 1])
@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("name", RULES)
def test_each_tick_of_a_playout_is_a_step_of_the_game_by_the_same_orders_and_chance(name: str, team: Team, plan: int) -> None:
    ruleset = RULES[name]
    games = games_on_one_board(ruleset, N_WORLDS)
    bring_together(games)
    bench, plans, fell = bench_of(games), plans_of(ruleset, team), 0
    for horizon in range(1, TICKS):
        for world in range(N_WORLDS):
            play_out(world, int(team), plan, plans, bench, np.uint64(5), horizon, 12)
        if horizon == 1 and plan == 1:
            first = games.n_units[Team.BLUE] * team
            assert (bench.orders[:, first : first + games.n_units[team]] == plans.first[1]).all()
        games.step(bench.orders)  # each playout of one tick more goes as the one before it did, up to this tick
        for field in ("cell", "alive", "field"):
            np.testing.assert_array_equal(getattr(bench.then.state, field), getattr(games.state, field), field)
        fell = int((games.state.alive == 0).sum())
    assert fell > 0, "there was something to be equal about"


@pytest.mark.parametrize("team", Team)
def test_a_playout_to_the_end_is_worth_what_the_match_comes_to(team: Team) -> None:
    ruleset = PAPER.with_({"tick_limit": 60})
    games = games_on_one_board(ruleset, 60, seed=1)
    bench, plans = bench_of(games), plans_of(ruleset, team)

    worth: dict[int, list[tuple[int, float]]] = {}
    for world in range(games.n_games):
        came_to = play_out(world, int(team), 0, plans, bench, np.uint64(5), 60, 60)
        winner = int(bench.then.state.field[world, StateField.WINNER])
        assert bench.then.state.field[world, StateField.ENDING]
        worth.setdefault(winner, []).append((int(bench.then.state.field[world, StateField.TICK]), came_to))

    wins, losses = sorted(worth[int(team)]), sorted(worth[int(team.other)])
    assert all(value > 0.9 for _, value in wins)
    assert all(value < 0.1 for _, value in losses)
    assert [value for _, value in wins] == sorted((value for _, value in wins), reverse=True), "the sooner the better"
    assert [value for _, value in losses] == sorted(value for _, value in losses), "the later the better"
    assert {value for _, value in worth.get(-1, [])} <= {0.5}


def test_a_playout_does_not_change_the_world_that_it_begins_in() -> None:
    bench = bench_of(games_on_one_board(PAPER, N_WORLDS))
    before = [array.copy() for array in (*bench.now.state, *bench.now[1:])]

    play_out(3, 0, 0, plans_of(PAPER, Team.BLUE), bench, np.uint64(5), 20, 12)

    for array, was in zip((*bench.now.state, *bench.now[1:]), before, strict=True):
        np.testing.assert_array_equal(array, was)


@pytest.mark.parametrize("name", RULES)
def test_a_cut_off_value_changes_its_sign_with_the_side(name: str) -> None:
    """A horizon of nothing leaves the value alone. It is of no use if it is the same everywhere."""
    ruleset, rng, values = RULES[name].with_({"tick_limit": 100}), np.random.default_rng(3), []
    for seed in range(5):
        games = games_on_one_board(ruleset, N_WORLDS, seed)
        open_cells = np.flatnonzero(games.state.ground[0, : ruleset.side**2] != Code.OBSTACLE)
        games.state.cell[:] = rng.choice(open_cells, games.state.cell.shape)
        games.state.alive[:] = rng.random(games.state.alive.shape) < 0.8
        games.state.field[:, StateField.TICK] = rng.integers(80, size=N_WORLDS)
        bench = bench_of(games)
        plans = {team: plans_of(ruleset, team) for team in Team}
        for world in range(N_WORLDS):
            blue, red = (play_out(world, int(team), 0, plans[team], bench, np.uint64(5), 0, 0) for team in Team)
            assert blue + red == pytest.approx(1.0, abs=1e-12)
            values.append(blue)

    assert 0.0 < min(values) < 0.5 < max(values) < 1.0


# Ways


def search_plainly(goal: int, is_open: np.ndarray) -> np.ndarray:
    """Return the steps to a cell from every cell; `NO_WAY` where none leads."""
    side = len(is_open)
    far = np.full((side, side), NO_WAY)
    if not is_open[divmod(goal, side)]:
        return far.ravel()
    far[divmod(goal, side)] = 0
    queue = deque([divmod(goal, side)])
    while queue:
        row, column = queue.popleft()
        for to in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            if min(to) >= 0 and max(to) < side and is_open[to] and far[to] == NO_WAY:
                far[to] = far[row, column] + 1
                queue.append(to)
    return far.ravel()


def ways_over(is_open: np.ndarray) -> Ways:
    side = len(is_open)
    ruleset = PAPER.with_({"side": side})
    belief, ways = make_belief(ruleset, Team.BLUE, 1), make_ways(side**2)
    belief.walkable[0] = (is_open * (np.uint64(1) << np.arange(side, dtype=np.uint64))).sum(axis=1, dtype=np.uint64)
    find_ways(belief, side, make_bench(ruleset, 1).tables, ways)
    find_ways(belief, side, make_bench(ruleset, 1).tables, ways)  # once more, over what the first left
    return ways


@pytest.mark.parametrize("share", [0.0, 0.2, 0.45, 1.0])
@pytest.mark.parametrize("side", [8, 14])
def test_ways_are_those_of_a_plain_search(side: int, share: float, size: Callable[[int, int], int]) -> None:
    rng = np.random.default_rng(side)
    for _ in range(size(3, 50)):
        is_open = rng.random((side, side)) >= share

        ways = ways_over(is_open)

        for goal in range(side**2):
            np.testing.assert_array_equal(ways.far[goal], search_plainly(goal, is_open))
        cells = np.argwhere(is_open)
        for cell in range(side**2):
            there = divmod(int(ways.open[cell]), side)
            nearest = np.abs(cells - divmod(cell, side)).max(axis=1).min() if len(cells) else 0
            assert np.abs(np.subtract(there, divmod(cell, side))).max() == nearest
            assert is_open[there] or not len(cells)


def test_a_way_that_is_too_long_to_count_is_told_from_none() -> None:
    is_open = np.ones((32, 32), np.bool_)
    is_open[1::4, :-1] = is_open[3::4, 1:] = False  # a snake of more than 500 steps

    far = ways_over(is_open).far[0].reshape(32, 32)

    assert (far[0] == np.arange(32)).all()
    assert far[28, 3] == NO_WAY - 1
    assert far[1, 0] == NO_WAY
