"""`Observation.from_board`: what is shown of a drawn board is what a real seat would be shown."""

import doctest
from typing import Any

import pytest

import arena.game.observation
from arena import Code, Observation, Team
from arena.errors import BoardError, UnknownNameError
from arena.game.board import format_board
from arena.game.ruleset import load
from arena.testing import SteppedMatch

BOARD = """
    F......f
    ........
    ........
    .UA.u..u

    ........
    ...#....
    ........
    .u......
    """
SEEN = "F....???\n......??\n......??\n.UA.u..?\n......??\n...#..??\n.....???\n??.?????"
"""By blue: its UGV sees 3 cells far, its UAV 4."""


def places(units: Any) -> list[tuple[int, int, str, bool]]:
    return sorted((unit.row, unit.column, unit.type, unit.flies) for unit in units)


def test_a_team_is_shown_what_its_units_see() -> None:
    seen = Observation.from_board(BOARD, tick=12)

    assert format_board(seen.grid) == SEEN
    assert (seen.tick, seen.team, seen.score, seen.living, seen.clock_s) == (12, Team.BLUE, 0, (2, 3), None)
    assert places(seen.units) == [(3, 1, "ugv", False), (3, 2, "uav", True)]
    assert places(seen.enemies) == [(3, 4, "ugv", False)]


def test_the_other_team_is_shown_the_board_from_its_side() -> None:
    seen = Observation.from_board(BOARD, team=Team.RED)

    assert places(seen.units) == [(3, 4, "ugv", False), (3, 7, "ugv", False), (7, 1, "ugv", False)]
    assert places(seen.enemies) == [(3, 1, "ugv", False), (3, 2, "uav", True)]
    assert seen.living == (3, 2)


@pytest.mark.parametrize("rules", ["paper", "gym-cap", "mirror"])
@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("seed", [0, 1, 2])  # blue's half is the left one, and the right one
def test_a_real_match_that_is_drawn_shows_what_it_showed(rules: str, team: Team, seed: int) -> None:
    match = SteppedMatch(rules, seed=seed)
    real, drawn = match.observe(team), Observation.from_board(match.text(), team=team, rules=rules)

    assert (drawn.ground == real.ground).all()
    assert places(drawn.units) == places(real.units)
    assert drawn.enemies == real.enemies
    assert (drawn.living, drawn.score, drawn.tick) == (real.living, real.score, real.tick)


def test_the_drawn_real_matches_have_blue_on_either_side() -> None:
    columns = {SteppedMatch("paper", seed=seed).units(Team.BLUE)[0].column < 10 for seed in (0, 1, 2)}

    assert columns == {True, False}


def test_the_rules_decide_what_is_seen_unless_the_fog_is_chosen() -> None:
    assert (Observation.from_board(BOARD, rules="gym-cap").ground != Code.HIDDEN).sum() > (
        Observation.from_board(BOARD).ground != Code.HIDDEN
    ).sum()
    assert format_board(Observation.from_board(BOARD, fog=False).grid).split() == BOARD.split()
    assert format_board(Observation.from_board(BOARD, rules=load("paper").with_({"fog": False})).grid).split() == BOARD.split()
    assert format_board(Observation.from_board(BOARD, rules=load("paper").with_({"fog": False}), fog=True).grid) == SEEN


def test_a_unit_that_has_fallen_lies_where_it_fell_sees_nothing_and_counts() -> None:
    seen = Observation.from_board(BOARD, team=Team.RED, fallen=[(3, 7), (7, 1)])

    assert [(unit.row, unit.column, unit.alive) for unit in seen.units] == [(3, 4, True), (3, 7, False), (7, 1, False)]
    assert (seen.living, seen.score) == ((1, 2), -20)
    assert seen.ground[7, 1] == Code.HIDDEN
    blue = Observation.from_board(BOARD, fallen=[(3, 7), (7, 1)])
    assert (blue.living, blue.score) == ((2, 1), 20)


def test_what_a_drawing_cannot_say_can_be_said() -> None:
    seen = Observation.from_board(BOARD, team=Team.RED, score=30, seed=2**64 - 1, clock_s=4.25)

    assert (seen.score, seen.seed, seen.clock_s) == (30, 2**64 - 1, 4.25)


@pytest.mark.parametrize(
    ("facts", "says"),
    [
        ({"tick": 100}, "tick is 100; while a match is running, it is 0 to 99"),
        ({"tick": -1}, "tick is -1"),
        ({"score": 101}, "score is 101; while a match is running, it is -100 to 100"),
        ({"seed": -1}, "seed is -1"),
        ({"clock_s": -0.5}, "clock_s is -0.5"),
        ({"fallen": [(0, 1)]}, "no UGV is drawn at row 0, column 1, counted from 0"),
        ({"fallen": [(3, 2)]}, "no UGV is drawn at row 3, column 2"),
        ({"fallen": [(3, 4), (3, 7), (7, 1)]}, "all UGVs of red have fallen, so the match is over"),
    ],
    ids=str,
)
def test_what_no_running_match_shows_is_refused(facts: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Observation.from_board(BOARD, **facts)


def test_a_board_or_a_ruleset_that_cannot_be_played_is_refused_as_everywhere() -> None:
    with pytest.raises(BoardError, match="row 2: 3 cells in a board of 4 rows"):
        Observation.from_board("F..u\nU..\n..A.\na..f\n")
    with pytest.raises(UnknownNameError, match="did you mean 'paper'"):
        Observation.from_board(BOARD, rules="papr")


def test_the_example_in_the_docstring_holds() -> None:
    done = doctest.testmod(arena.game.observation)

    assert (done.failed, done.attempted > 0) == (0, True)
