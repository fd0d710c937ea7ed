"""Boards as text: both layouts, what a match makes of them, and the sentence that each bad one gets."""

import numpy as np
import pytest
from worlds import drawing, facts_of, lay, picture, rules_for

from arena.errors import BoardError, RulesetError
from arena.game.board import parse_board
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import from_dict, load
from arena.game.state import StateField
from arena.game.types import Team

LETTERS = """
    F . # . . .
    U A # . u .
    . . . . . .
    . . . # a .
    . U . # . f
    . . . . . .
    """
NUMBERS = """
    6 0 8 1 1 1
    2 3 8 1 4 1
    0 0 0 1 1 1
    0 0 0 8 5 1
    0 2 0 8 1 7
    0 0 0 1 1 1
    """


def test_letters_and_numbers_draw_the_same_board() -> None:
    one, other = parse_board(LETTERS), parse_board(NUMBERS)

    assert (one.ground == other.ground).all()
    assert (one.walkers, one.flyers) == (other.walkers, other.flyers)
    assert one.side == 6
    assert (one.flag(Team.BLUE), one.flag(Team.RED)) == ((0, 0), (4, 5))
    assert one.walkers == (((1, 0), (4, 1)), ((1, 4),))
    assert one.flyers == (((1, 1),), ((3, 4),))


def test_what_lies_under_the_units_is_land() -> None:
    ground = parse_board(LETTERS).ground

    assert ground.tolist() == [
        [6, 0, 8, 1, 1, 1],
        [0, 0, 8, 1, 1, 1],
        [0, 0, 0, 1, 1, 1],
        [0, 0, 0, 8, 1, 1],
        [0, 0, 0, 8, 1, 7],
        [0, 0, 0, 1, 1, 1],
    ]
    assert not ground.flags.writeable


def test_in_letters_a_unit_on_the_enemys_half_stands_on_the_enemys_land() -> None:
    ground = parse_board("F . U f\nu . . .\n. a . .\n. . A .").ground

    assert ground.tolist() == [[6, 0, 1, 7], [0, 0, 1, 1], [0, 0, 1, 1], [0, 0, 1, 1]]


def test_in_numbers_a_unit_stands_on_its_own_teams_land() -> None:
    ground = parse_board("7 1 0 6\n1 4 2 0\n1 5 3 0\n1 1 0 0").ground

    assert ground.tolist() == [[7, 1, 0, 6], [1, 1, 0, 0], [1, 1, 0, 0], [1, 1, 0, 0]]


@pytest.mark.parametrize("text", [LETTERS, NUMBERS])
def test_a_match_starts_as_its_board_is_drawn(text: str) -> None:
    rules = rules_for(text)
    games = BatchedGame(rules, 3)
    games.start([0, 1, 2], [MatchKeys(map_key=bytes([i] * 32), match_key=bytes([i] * 32)) for i in range(3)])

    for row in range(3):
        assert picture(games, row) == drawing(LETTERS)
        facts = facts_of(games, row)
        assert facts["living"] == [3, 2]
        assert facts["cells"] == [(1, 0), (4, 1), (1, 1), (1, 4), (3, 4)]
        assert (facts["tick"], facts["ending"], facts["winner"], facts["score"]) == (0, 0, -1, 0)
        assert games.state.field[row, [StateField.BLUE_FLAG, StateField.RED_FLAG]].tolist() == [0, 29]
    assert (games.state.key[0] != games.state.key[1]).all()


def test_the_board_sets_side_and_teams() -> None:
    rules = rules_for(LETTERS)

    assert rules.side == 6
    assert [unit.name for unit in rules.team(Team.BLUE)] == ["ugv", "ugv", "uav"]
    assert [unit.name for unit in rules.team(Team.RED)] == ["ugv", "uav"]


def test_a_board_shown_in_numbers_reads_back_as_itself() -> None:
    """The Table 2 board of a full view is the text of the earlier public version."""
    games = lay(rules_for(LETTERS, fog=False))
    grid = games.grids()[0, 0]
    text = "\n".join(" ".join(str(code) for code in row) for row in grid.tolist())

    assert np.array_equal(parse_board(text).ground, parse_board(LETTERS).ground)
    assert parse_board(text).walkers == parse_board(LETTERS).walkers


def test_letters_may_stand_close_together() -> None:
    assert np.array_equal(parse_board("F..f\n....\n....\nU..u").ground, parse_board("F . . f\n. . . .\n. . . .\nU . . u").ground)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("F . . .\n. . . .\n. . . .\nU . . u", "board: no red flag; each team needs one"),
        (". . . f\n. . . .\n. . . .\nU . . u", "board: no blue flag; each team needs one"),
        ("F . . f\n. . . .\n. . . f\nU . . u", "board: 2 red flags; each team needs one"),
        ("F F . f\n. . . .\n. . . .\nU . . u", "board: 2 blue flags; each team needs one"),
        ("F . f\n. . .\nU . u", "board: 3 x 3 cells; the side must be even, from 4 to 64"),
        ("F f\nU u", "board: 2 x 2 cells; the side must be even, from 4 to 64"),
        ("", "board: 0 x 0 cells; the side must be even, from 4 to 64"),
        ("F . . f\n. . .\n. . . .\nU . . u", "board, row 2: 3 cells in a board of 4 rows; it must be square"),
        ("F . . f\n. . . .\nU . . u", "board, row 1: 4 cells in a board of 3 rows; it must be square"),
        ("F . . f\n. . . .\n. . x .\nU . . u", "board, row 3, column 3: 'x' is no cell; a board is drawn with the letters"),
        ("6 0 1 7\n0 0 1 1\n0 9 1 1\n2 0 1 4", "board, row 3, column 2: '9' is no cell"),
        ("6 0 1 7\n0 -1 1 1\n0 0 1 1\n2 0 1 4", "board, row 2, column 2: '-1' is no cell"),
        ("6 0 1 7\n0 10 1 1\n0 0 1 1\n2 0 1 4", "board, row 2, column 2: '10' is no cell"),
        (
            "F . # f\n. . # #\n. . . .\nU . . u",
            "board: the blue UGV at row 4, column 1 has no way to the enemy flag at row 1, column 4",
        ),
        (
            "F # . f\n# . . .\n. . . .\nU . . u",
            "board: the red UGV at row 4, column 4 has no way to the enemy flag at row 1, column 1",
        ),
    ],
)
def test_a_bad_board_is_refused_with_what_is_wrong_and_where(text: str, sentence: str) -> None:
    with pytest.raises(BoardError) as refusal:
        parse_board(text)

    assert str(refusal.value).startswith(sentence)
    assert "\n" not in str(refusal.value)
    assert refusal.value.exit_code == 2


def test_a_superscript_is_no_number() -> None:
    with pytest.raises(BoardError, match="'²' is no cell"):
        parse_board("F . . f\n. ² . .\n. . . .\nU . . u")


def test_a_uav_needs_no_way() -> None:
    board = parse_board("F # . f\n# # # .\n# # . .\nA . # u".replace("u", "a"))

    assert board.flyers == (((3, 0),), ((3, 3),))


def test_a_bad_board_in_a_ruleset_is_the_same_sentence() -> None:
    with pytest.raises(BoardError, match="board: no red flag"):
        load("paper").with_({"board": "F...\n....\n....\n...."})


def test_a_board_with_more_units_than_a_team_may_have_is_refused() -> None:
    text = "F....f\nUUUUU.\nUUUUU.\nUUUUU.\nUU...u\n......"

    with pytest.raises(RulesetError, match="blue has 17 units; 16 is the most"):
        rules_for(text)


def test_a_board_with_more_units_of_both_kinds_than_a_team_may_have_is_refused() -> None:
    text = "F....f\nUUUUU.\nUUUU..\nAAAAA.\nAAAA..\n......"

    with pytest.raises(RulesetError, match="blue has 18 units; 16 is the most"):
        rules_for(text)


def test_a_board_with_units_that_no_type_fits_is_refused() -> None:
    walkers_only = {"units": {"ugv": {"step": 1, "sight": 1}}, "board": "F..f\nA...\n....\n...."}

    with pytest.raises(RulesetError, match="the board has units that fly, and no unit type does"):
        from_dict("own", walkers_only)
