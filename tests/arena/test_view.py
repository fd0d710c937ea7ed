"""Boards for people: letters, colours, and two side by side."""

import numpy as np
import pytest
from rich.console import Console

from arena.game.board import parse_board
from arena.game.ruleset import load
from arena.game.types import Code
from arena.games import Games
from arena.view import LEGEND, draw_board, draw_pair

EVERY_CODE = np.array([[-1, 0, 1], [2, 3, 4], [5, 6, 7], [8, 8, 8]], np.int8)
LETTERS = [" ··", "UAu", "aFf", "###"]


def printed(what: object, width: int = 200, color: bool = False) -> list[str]:
    console = Console(width=width, force_terminal=color, color_system="truecolor" if color else None)
    with console.capture() as capture:
        console.print(what)
    return capture.get().splitlines()


def test_every_code_has_its_letter() -> None:
    assert draw_board(EVERY_CODE, is_wide=False).plain.split("\n") == LETTERS
    assert set(EVERY_CODE.ravel().tolist()) == {int(code) for code in Code}


def test_wide_cells_are_two_columns() -> None:
    assert draw_board(EVERY_CODE, is_wide=True).plain.split("\n") == ["".join(f"{c} " for c in line) for line in LETTERS]


def test_a_team_is_told_apart_without_colours() -> None:
    shown = {code: draw_board(np.array([[code]], np.int8), is_wide=False).plain for code in Code}
    seen = [shown[code] for code in Code if code not in (Code.BLUE_HALF, Code.RED_HALF)]

    assert len(set(seen)) == len(seen)


def test_halves_are_told_apart_by_colour() -> None:
    blue, red = (printed(draw_board(np.array([[code]], np.int8), is_wide=False), color=True) for code in (0, 1))

    assert blue != red
    assert "\x1b[" in blue[0]


def test_the_legend_names_the_letters_of_a_board_drawn_as_text() -> None:
    text = "F..u\nU...\n..A.\na..f\n"
    board = parse_board(text)
    games = Games(load("paper").with_({"board": text}), 1)

    assert board.side == games.ruleset.side
    assert set("UAFuaf#") <= set(LEGEND)


@pytest.mark.parametrize(("width", "cell"), [(200, 2), (83, 2), (82, 1), (43, 1)])
def test_two_boards_stand_side_by_side_in_any_width(width: int, cell: int) -> None:
    left, right = np.full((20, 20), Code.OBSTACLE, np.int8), np.full((20, 20), Code.BLUE_UGV, np.int8)

    title, names, *rows = printed(draw_pair("a title", ("seen", left), ("truth", right), width), width)

    assert (title, names.split()) == ("a title", ["seen", "truth"])
    assert [row.rstrip() for row in rows] == [
        ("# " if cell == 2 else "#") * 20 + "   " + ("U " * 20 if cell == 2 else "U" * 20).rstrip()
    ] * 20
