"""Drawn boards: what the oracle draws, what the design promises of each, and what chance promises of many."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import oracle
import pytest
from hypothesis import given
from worlds import SEEDS, is_near, lay, rules_for, rulesets

from arena.errors import BoardError
from arena.game.draw import is_open
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, philox_keys
from arena.game.ruleset import RULESETS, Ruleset, load
from arena.game.state import StateField
from arena.game.types import Code, Team, Termination

EYE = {"step": 1, "sight": 1, "flies": True, "blue": 1, "red": 1}


def key(number: int) -> MatchKeys:
    return MatchKeys(map_key=number.to_bytes(32, "little"), match_key=bytes(32))


def start(rules: Ruleset, n_games: int) -> BatchedGame:
    games = BatchedGame(rules, n_games)
    games.start(range(n_games), [key(number) for number in range(n_games)])
    return games


def boards(games: BatchedGame) -> np.ndarray:
    side = games.ruleset.side
    return games.state.ground[:, : side * side].reshape(-1, side, side)


def drawn(games: BatchedGame, row: int) -> oracle.Drawn:
    """Read a row as the oracle writes one."""
    side, state = games.ruleset.side, games.state
    cells = [divmod(int(cell), side) for cell in state.cell[row]]
    n_blue = games.n_units[Team.BLUE]
    ground = {divmod(cell, side): int(state.ground[row, cell]) for cell in range(side * side)}
    flags = [divmod(int(state.field[row, StateField.BLUE_FLAG + team]), side) for team in Team]
    return oracle.Drawn(0, ground, flags, [cells[:n_blue], cells[n_blue:]])


def words_of(number: int) -> oracle.Key:
    one, other = philox_keys([key(number)]).board[0]
    return int(one), int(other)


def assert_sound(rules: Ruleset, board: oracle.Drawn) -> None:
    """What the design promises of every board."""
    side = rules.side
    blue_is_left = sum(board.ground[cell] in (0, 6) for cell in board.ground if cell[1] < side // 2) > 0
    for (_, column), code in board.ground.items():
        is_blue = (column < side // 2) == blue_is_left
        assert code in (
            (Code.BLUE_HALF, Code.BLUE_FLAG, Code.OBSTACLE) if is_blue else (Code.RED_HALF, Code.RED_FLAG, Code.OBSTACLE)
        )
    for team in Team:
        assert [cell for cell, code in board.ground.items() if code == oracle.FLAG[team]] == [board.flags[team]]
        assert all(board.ground[cell] == oracle.HALF[team] for cell in board.cells[team])
        if rules.flag_in_back_third:
            assert min(board.flags[team][1], side - 1 - board.flags[team][1]) < max(1, side // 6)
    everybody = [*board.flags, *board.cells[0], *board.cells[1]]
    assert len(set(everybody)) == len(everybody)
    assert oracle.is_playable(rules, board)
    n_obstacles = sum(code == Code.OBSTACLE for code in board.ground.values())
    most = int(side**0.5) * (2 * max(1, side // 5)) ** 2 if rules.obstacles else 0
    assert n_obstacles <= (2 * most if rules.mirror else most)
    if rules.mirror:
        for (row, column), code in board.ground.items():
            across = board.ground[side - 1 - row, side - 1 - column]
            assert across == {0: 1, 1: 0, 6: 7, 7: 6, 8: 8}[code]
        assert [(side - 1 - row, side - 1 - column) for row, column in board.cells[0]] == board.cells[1]


@given(rulesets(equal_teams=False) | rulesets(equal_teams=True), SEEDS)
def test_a_board_is_what_the_oracle_draws(rules: Ruleset, seed: int) -> None:
    """Where the kernel finds none of a thousand, the oracle, slow at giving up, looks at some of them."""
    games = BatchedGame(rules, 1)
    try:
        games.start([0], [key(seed)])
    except BoardError:
        tried = [oracle.draw_once(rules, words_of(seed), attempt) for attempt in (0, 1, 2, 500, 999)]
        assert not any(board and oracle.is_playable(rules, board) for board in tried)
        return

    board, expected = drawn(games, 0), oracle.draw(rules, words_of(seed))
    assert expected is not None
    assert (board.ground, board.flags, board.cells) == (expected.ground, expected.flags, expected.cells)
    assert games.state.alive.all()
    fact = games.state.field[0]
    assert fact[[StateField.TICK, StateField.ENDING, StateField.WINNER, StateField.SCORE]].tolist() == [
        0,
        Termination.RUNNING,
        -1,
        0,
    ]
    assert fact[[StateField.BLUE_LIVING, StateField.RED_LIVING]].tolist() == [len(rules.team(team)) for team in Team]
    assert_sound(rules, board)


@pytest.mark.parametrize("side", [8, 20, 64])
def test_boards_of_many_keys_are_what_the_oracle_draws(side: int, size: Callable[[int, int], int]) -> None:
    """At side 8 one board in thirty has a flag with no way but along its row, which the kernel once took for closed."""
    rules = load("exp2").with_({"side": side})
    games = start(rules, size(max(12, 3_000 // side**2 * 8), 2_000))
    for row in range(games.n_games):
        board, expected = drawn(games, row), oracle.draw(rules, words_of(row))
        assert expected is not None
        assert (board.ground, board.flags, board.cells) == (expected.ground, expected.flags, expected.cells), row


def test_a_flag_in_a_gap_that_is_open_to_its_sides_alone_can_be_reached() -> None:
    text = """
        F . . . . .
        U . . . . .
        . . . # # .
        . . . . f .
        . . . # # .
        . . . . . u
        """
    games = lay(rules_for(text))

    assert is_open(0, games.state, games.tables, np.zeros((2, 8), np.uint64))


def test_a_flag_behind_walls_cannot_be_reached() -> None:
    games = lay(rules_for("F . . . . .\nU . . . . .\n. . . # # #\n. . . . f .\n. . . # # #\n. . . . . u"))
    for cell in (3 * 6 + 3, 3 * 6 + 5):
        games.state.ground[0, cell] = Code.OBSTACLE

    assert not is_open(0, games.state, games.tables, np.zeros((2, 8), np.uint64))


@pytest.mark.parametrize("name", RULESETS)
def test_every_board_is_as_designed(name: str, size: Callable[[int, int], int]) -> None:
    games = start(load(name), size(200, 5_000))
    for row in range(games.n_games):
        assert_sound(games.ruleset, drawn(games, row))


@pytest.mark.parametrize("name", ["paper", "mirror"])
def test_blue_lies_on_either_side_half_of_the_time(name: str) -> None:
    rules = replace(load(name), obstacles=False)
    games = start(rules, 4_000)
    is_left = np.isin(boards(games)[:, :, 0], [Code.BLUE_HALF, Code.BLUE_FLAG]).all(axis=1)
    is_right = np.isin(boards(games)[:, :, -1], [Code.BLUE_HALF, Code.BLUE_FLAG]).all(axis=1)

    assert (is_left != is_right).all()
    assert is_near(is_left.mean(), 1 / 2, 4_000)


def chi_square(counts: np.ndarray) -> float:
    """Return how far counts lie from equal ones, in standard deviations."""
    expected = counts.sum() / counts.size
    assert expected >= 5, "too few to tell"
    freedom = counts.size - 1
    return float(((counts - expected) ** 2 / expected).sum() - freedom) / (2 * freedom) ** 0.5


def test_flags_and_units_lie_anywhere_on_their_half_equally_often() -> None:
    n = 12_000
    games = start(load("paper").with_({"obstacles": False, "side": 8}), n)
    is_left = np.isin(boards(games)[:, 0, 0], [Code.BLUE_HALF, Code.BLUE_FLAG])
    things = [games.state.field[:, StateField.BLUE_FLAG], games.state.field[:, StateField.RED_FLAG], *games.state.cell.T]
    for number, cells in enumerate(things):
        is_blue = number == 0 or 2 <= number < 8
        rows, columns = np.divmod(cells, 8)
        depth = np.where(is_left == is_blue, columns, columns - 4)
        assert chi_square(np.bincount(rows * 4 + depth, minlength=32)) < 5


def test_things_of_one_team_are_placed_independently_but_for_the_cells_that_are_taken() -> None:
    games = start(load("paper").with_({"obstacles": False, "side": 8}), 12_000)
    is_left = np.isin(boards(games)[:, 0, 0], [Code.BLUE_HALF, Code.BLUE_FLAG])
    rows, columns = np.divmod(games.state.cell[:, :2], 8)
    cells = rows * 4 + np.where(is_left[:, None], columns, columns - 4)
    apart = (cells[:, 0] - cells[:, 1]) % 32

    assert (apart != 0).all()
    assert chi_square(np.bincount(apart, minlength=32)[1:]) < 5


def test_obstacles_lie_anywhere() -> None:
    """By the middle of the board, where no border cuts: every cell is covered equally often, and by 4 rectangles of 2 to 8."""
    rules = load("paper").with_({"units": {"ugv": {"blue": 0, "red": 0}, "uav": {"blue": 0, "red": 0}}})
    n = 6_000
    covered = (boards(start(rules, n)) == Code.OBSTACLE)[:, 5:15, 5:15].mean(axis=0)
    # A cell lies in one rectangle with chance (mean of 2h / 20) squared, h uniform in 1..4; there are four.
    one = (np.mean([2 * h for h in (1, 2, 3, 4)]) / 20) ** 2

    assert abs(covered.mean() - (1 - (1 - one) ** 4)) < 0.01
    assert covered.max() - covered.min() < 0.05


def test_a_mirror_board_favours_nobody_and_hides_its_flags_at_the_back() -> None:
    games = start(load("mirror"), 300)
    columns = games.state.field[:, [StateField.BLUE_FLAG, StateField.RED_FLAG]] % 20

    assert (np.minimum(columns, 19 - columns) < 3).all()
    assert set(np.minimum(columns, 19 - columns).ravel().tolist()) == {0, 1, 2}
    assert (games.state.cell[:, :6] + games.state.cell[:, 6:] == 399).all()


def test_another_map_key_is_another_board_and_the_same_the_same() -> None:
    games = start(load("paper"), 200)
    again = start(load("paper"), 200)

    assert len({row.tobytes() for row in games.state.ground}) == 200
    assert (games.state.ground == again.state.ground).all()


def test_boards_that_are_closed_are_drawn_again() -> None:
    """Some first attempts must be refused, or the ways are not looked at."""
    rules = load("paper").with_({"side": 10})
    attempts = [found.attempt for found in (oracle.draw(rules, words_of(number)) for number in range(200)) if found]
    games = start(rules, 200)

    assert max(attempts) >= 1
    for row in range(200):
        assert oracle.is_playable(rules, drawn(games, row))


@pytest.mark.parametrize(
    "overrides",
    [
        {"side": 4, "units": {"ugv": {"blue": 8}, "uav": {"blue": 2}}},
        {"side": 4, "obstacles": False, "units": {"ugv": {"red": 6}, "uav": {"red": 2}}},
    ],
)
def test_a_ruleset_without_room_is_refused_in_one_sentence(overrides: dict[str, object]) -> None:
    games = BatchedGame(load("paper").with_(overrides), 1)

    with pytest.raises(BoardError) as refusal:
        games.start([0], [key(0)])

    assert str(refusal.value) == (
        "ruleset paper: none of 1000 boards had room for every unit and a way to the flag for each; "
        "use a larger side, fewer units or no obstacles"
    )


def test_a_half_that_is_just_full_can_be_drawn() -> None:
    rules = load("paper").with_(
        {"side": 4, "obstacles": False, "units": {"ugv": {"blue": 5, "red": 5}, "uav": {"blue": 2, "red": 2}}}
    )

    assert_sound(rules, drawn(start(rules, 1), 0))


def test_only_those_that_walk_need_a_way() -> None:
    """Side 64 floods rows of a full word; fliers alone are never drawn again."""
    rules = Ruleset(name="eyes", side=64).with_({"units": {"eye": EYE}})
    games = start(rules, 20)

    for row in range(20):
        found = oracle.draw(rules, words_of(row))
        assert found is not None
        assert found.attempt == 0
        assert drawn(games, row).cells == found.cells
