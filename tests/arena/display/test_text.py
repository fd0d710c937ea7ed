"""Boards for people: letters, colours, and two side by side."""

import numpy as np
import pytest
from rich.console import Console

from arena.display.text import LEGEND, draw_board, draw_row, is_live
from arena.game.board import parse_board
from arena.game.engine import BatchedGame
from arena.game.ruleset import load
from arena.game.types import Code

EVERY_CODE = np.array([[-1, 0, 1], [2, 3, 4], [5, 6, 7], [8, 8, 8]], np.int8)
LETTERS = [" ·:", "UAu", "aFf", "###"]


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

    assert len(set(shown.values())) == len(Code)


def test_halves_are_told_apart_by_colour() -> None:
    blue, red = (printed(draw_board(np.array([[code]], np.int8), is_wide=False), color=True) for code in (0, 1))

    assert blue != red
    assert "\x1b[" in blue[0]


def test_the_legend_names_the_letters_of_a_board_drawn_as_text() -> None:
    text = "F..u\nU...\n..A.\na..f\n"
    board = parse_board(text)
    games = BatchedGame(load("paper").with_({"board": text}), 1)

    assert board.side == games.ruleset.side
    assert set("UAFuaf#·:") <= set(LEGEND)


@pytest.mark.parametrize(("width", "cell"), [(200, 2), (83, 2), (82, 1), (43, 1)])
def test_two_boards_stand_side_by_side_in_any_width(width: int, cell: int) -> None:
    left, right = np.full((20, 20), Code.OBSTACLE, np.int8), np.full((20, 20), Code.BLUE_UGV, np.int8)

    title, names, *rows = printed(draw_row("a title", [("seen", left), ("truth", right)], width), width)

    assert (title, names.split()) == ("a title", ["seen", "truth"])
    assert [row.rstrip() for row in rows] == [
        ("# " if cell == 2 else "#") * 20 + "   " + ("U " * 20 if cell == 2 else "U" * 20).rstrip()
    ] * 20


def test_boards_stand_one_under_the_other_where_they_do_not_fit_side_by_side() -> None:
    left, right = np.full((20, 20), Code.OBSTACLE, np.int8), np.full((20, 20), Code.BLUE_UGV, np.int8)

    lines = printed(draw_row("a title", [("seen", left), ("truth", right)], 40), 40)

    assert [line.rstrip() for line in lines] == ["a title", "seen", *["#" * 20] * 20, "truth", *["U" * 20] * 20]


@pytest.mark.parametrize(("n_boards", "height"), [(2, 22), (3, 22)])
def test_boards_fit_a_screen_of_80_columns_and_24_rows(n_boards: int, height: int) -> None:
    grid = np.full((20, 20), Code.OBSTACLE, np.int8)

    lines = printed(draw_row("a title", [("seen", grid)] * n_boards, 80), 80)

    assert len(lines) == height
    assert all(len(line.rstrip()) <= 80 for line in lines)
    assert lines[-1].count("#" * 20) == n_boards


@pytest.mark.parametrize(("width", "is_beside"), [(80, True), (50, False)])
def test_what_stands_aside_costs_no_row_where_there_is_room(width: int, is_beside: bool) -> None:
    grid = np.full((20, 20), Code.OBSTACLE, np.int8)

    lines = printed(draw_row("a title", [("seen", grid), ("truth", grid)], width, aside="orders\nugv 0 north"), width)

    assert len(lines) == (22 if is_beside else 24)
    assert any(line.rstrip().endswith("#   ugv 0 north") for line in lines) is is_beside
    assert (lines[2].rstrip() == "ugv 0 north") is not is_beside


def test_marks_stand_over_the_letters_in_the_width_of_a_cell() -> None:
    grid = np.array([[Code.BLUE_HALF, Code.BLUE_UGV]], np.int8)
    marks = {(0, 0): ("12", "bold"), (0, 1): ("", "reverse")}

    assert draw_board(grid, is_wide=True, marks=marks).plain == "12U "
    assert draw_board(grid, is_wide=False, marks=marks).plain == "1U"


@pytest.mark.parametrize(
    ("term", "no_color", "live", "coloured"),
    [("xterm-256color", "", True, True), ("xterm-256color", "1", True, False), ("dumb", "", False, False)],
)
def test_without_colours_there_are_letters(term: str, no_color: str, live: bool, coloured: bool) -> None:
    console = Console(width=80, force_terminal=True, _environ={"TERM": term, "NO_COLOR": no_color})
    with console.capture() as capture:
        console.print(draw_board(EVERY_CODE, is_wide=False))

    assert is_live(console) is live
    assert ("[38;" in capture.get() or ";38;" in capture.get()) is coloured
    assert "U" in capture.get()


def test_a_screen_that_is_too_small_for_two_boards_says_what_is_missing() -> None:
    grid = np.full((20, 20), Code.HIDDEN, np.int8)
    boards = [("what blue sees", grid), ("the truth", grid)]

    lines = printed(draw_row("a title", boards, 40, height=24), 40)

    assert (len(lines), lines[0], lines[1], lines[-1]) == (23, "a title", "what blue sees", "the truth: from 43 columns on")
    assert len(printed(draw_row("a title", boards, 40, height=43), 40)) == 43
    assert len(printed(draw_row("a title", boards, 43, height=24), 43)) == 22
