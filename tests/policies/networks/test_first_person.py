"""The paper's view of one unit: against a slow reading of section 3 and Figure 3."""

import numpy as np
import pytest

from arena.envs.batched import BatchedEnv
from arena.game.ruleset import load
from arena.game.types import FLAGS, HALVES, UAVS, UGVS, Code, Team
from policies.networks.first_person import FirstPerson

PAPER = load("paper")


def view_of(grid: np.ndarray, team: Team, row: int, column: int, window: int, edge: Code) -> np.ndarray:
    """Return a unit's view, cell by cell."""
    side = len(grid)
    own_columns = np.argwhere(grid == HALVES[team])[:, 1]
    is_turned = (own_columns >= side // 2).mean() > 0.5
    if is_turned:
        grid, column = grid[:, ::-1], side - 1 - column
    new = {int(code): int(code) for code in Code}
    if team is Team.RED:
        for blue, red in (HALVES, FLAGS, UGVS, UAVS):
            new[int(blue)], new[int(red)] = int(red), int(blue)
    view = np.full((window, window), edge, np.int8)
    for r in range(window):
        for c in range(window):
            there_row, there_column = row + r - window // 2, column + c - window // 2
            if 0 <= there_row < side and 0 <= there_column < side:
                view[r, c] = new[int(grid[there_row, there_column])]
    return view


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize(
    ("side", "window", "edge"),
    [
        (20, 20, Code.HIDDEN), (28, 20, Code.HIDDEN), (16, 20, Code.HIDDEN), (20, 12, Code.HIDDEN), (16, 21, Code.OBSTACLE),
        (12, 23, Code.HIDDEN),
    ],
)  # fmt: skip
def test_views_are_the_board_around_each_unit(team: Team, side: int, window: int, edge: Code) -> None:
    ruleset, rng = PAPER.with_({"side": side}), np.random.default_rng(1)
    env = BatchedEnv(ruleset, 6, seed=2)
    flies = np.array([unit.flies for unit in ruleset.team(team)], np.uint8)
    cutter, turned = FirstPerson(team, side, flies, 6, window, edge), set()
    for _ in range(25):
        seen = env.observe()[team]
        views = cutter.cut(seen)
        turned |= set(cutter.is_turned.tolist())
        for seat in range(6):
            told = seen.seat(seat, ruleset)
            for unit in told.units:
                wanted = view_of(told.grid, team, unit.row, unit.column, window, edge)
                if not unit.alive:
                    wanted = np.full((window, window), Code.HIDDEN)
                np.testing.assert_array_equal(views[seat, unit.index], wanted)
                if window >= 2 * side - 1 and unit.alive:  # all of the board, wherever the unit stands
                    assert (wanted != edge).sum() == (told.grid != edge).sum()
        env.step({one: rng.integers(0, 5, (6, 6)).astype(np.int8) for one in Team})
    assert turned == {0, 1}


@pytest.mark.parametrize(("window", "units_blind", "matches_blind"), [(20, 0.67, 0.34), (21, 0.58, 0.23), (39, 0.0, 0.0)])
def test_without_fog_a_window_as_wide_as_the_board_often_shows_no_flag(
    window: int, units_blind: float, matches_blind: float
) -> None:
    ruleset = load("exp1")
    seen = BatchedEnv(ruleset, 400, seed=3).observe()[Team.BLUE]

    views = FirstPerson(Team.BLUE, ruleset.side, np.zeros(4, np.uint8), 400, window).cut(seen)
    shows_flag = (views == Code.RED_FLAG).any((2, 3))

    assert not (seen.ground[:, : ruleset.side**2] == Code.HIDDEN).any()
    assert (~shows_flag).mean() == pytest.approx(units_blind, abs=0.06)
    assert (~shows_flag.any(1)).mean() == pytest.approx(matches_blind, abs=0.09)
