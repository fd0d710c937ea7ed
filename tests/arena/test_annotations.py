from typing import Any

import msgpack
import numpy as np
import pytest

from arena.annotations import MOST_BYTES, Annotations, read_annotations
from arena.errors import UnreadableError
from arena.game.observation import Observations
from arena.game.ruleset import load
from arena.game.types import Team

PAPER = load("paper")


@pytest.fixture
def notes() -> Annotations:
    return Annotations(20)


def kept(notes: Annotations) -> dict[str, Any]:
    return read_annotations(notes.pack(), 20)


def test_what_is_noted_is_what_is_read(notes: Annotations) -> None:
    notes.log("flag at", (3, 4))
    notes.draw.cell(3, 4, "red", "A")
    notes.draw.path(np.array([[1, 2], [1, 3]]))
    notes.draw.heat(np.eye(20), "blue")

    assert kept(notes) == {
        "log": ["flag at (3, 4)"],
        "draw": [
            {"cell": [3, 4], "colour": "red", "text": "A"},
            {"path": [[1, 2], [1, 3]], "colour": "yellow"},
            {"heat": bytes(np.eye(20, dtype=np.uint8) * 255), "colour": "blue"},
        ],
    }


def test_nothing_noted_is_no_byte(notes: Annotations) -> None:
    assert notes.pack() == b""
    assert kept(notes) == {"log": [], "draw": []}


def test_an_observation_notes_only_where_somebody_keeps_it(notes: Annotations) -> None:
    blank = Observations.blank(PAPER, Team.BLUE, 1)
    for seen in (blank.seat(0, PAPER), blank.seat(0, PAPER, notes)):
        seen.log("hello")
        seen.draw.cell(0, 0)

    assert blank.seat(0, PAPER).annotations is None
    assert kept(notes) == {"log": ["hello"], "draw": [{"cell": [0, 0], "colour": "yellow", "text": ""}]}


@pytest.mark.parametrize(
    ("drawing", "why"),
    [
        ({"cell": (40, 3)}, "row 40, column 3 lies off the board of 20 by 20"),
        ({"cell": (-1, 3)}, "row -1, column 3 lies off the board of 20 by 20"),
        ({"cell": (None, 3)}, "(None, 3) is no cell; a cell is a row and a column"),
        ({"cell": None}, "None is no cell; a cell is a row and a column"),
        ({"cell": (1, 2, 3)}, "a cell is a row and a column"),
        ({"cell": (1.5, 2)}, "(1.5, 2) is no cell"),
        ({"cell": (1, 2), "colour": "pink"}, "there is no colour 'pink', only red, orange"),
        ({"path": [(0, 0), (0, 20)]}, "row 0, column 20 lies off the board"),
        ({"path": 3}, "a path is a list of cells"),
        ({"path": [(0, 0)] * 401}, "a path has 400 cells at most"),
        ({"heat": np.zeros((20, 19))}, "heat has shape (20, 19), and the board is 20 by 20"),
        ({"heat": [["a"] * 20] * 20}, "heat is an array of numbers"),
        ({"heat": [[10**400] * 20] * 20}, "heat is an array of numbers"),
        ({"cell": (1, 2), "colour": np.array(["red", "red"])}, "there is no colour \"['red' 'red']\", only red, orange"),
        ({"cell": (10**5000, 0)}, "it cannot be read (ValueError)"),
        ({}, "it has no cell, no path and no heat"),
    ],
)
def test_a_drawing_that_cannot_be_kept_is_a_line_of_the_log(drawing: dict[str, Any], why: str, notes: Annotations) -> None:
    for _ in range(3):
        notes.add_drawing(drawing)
    notes.draw.cell(0, 0)

    (line,) = kept(notes)["log"]
    assert line.startswith(f"arena: a drawing was left out: {why}")
    assert len(kept(notes)["draw"]) == 1


def test_heat_is_scaled_to_its_largest_value_and_what_is_no_number_is_nothing(notes: Annotations) -> None:
    values = np.full((20, 20), -5.0)
    values[0, :5] = [10, 5, 0.001, np.nan, np.inf]

    notes.draw.heat(values)
    notes.draw.heat(np.zeros((20, 20)))

    heats = [list(drawing["heat"]) for drawing in kept(notes)["draw"]]
    assert heats[0][:6] == [255, 128, 1, 0, 0, 0]
    assert heats[1] == [0] * 400


def test_a_heat_has_a_label_of_some_letters_where_it_was_given_one(notes: Annotations) -> None:
    for label in ("", "ugv 1", "x" * 30):
        notes.draw.heat(np.eye(20), "blue", label)

    assert [drawing.get("label") for drawing in kept(notes)["draw"]] == [None, "ugv 1", "x" * 20]


def test_notes_are_whole_until_something_is_cut_or_left_out(notes: Annotations) -> None:
    notes.log("x" * 3_000)
    notes.draw.cell(1, 1)
    assert notes.is_whole

    notes.log("x" * 3_000)
    assert not notes.is_whole
    other = Annotations(20)
    other.draw.cell(20, 1)
    assert not other.is_whole


@pytest.mark.parametrize("largest", [1.6527635528529094, 29.971189053738478, 5e-324])
def test_the_largest_value_is_full_heat_whatever_it_is(largest: float, notes: Annotations) -> None:
    notes.draw.heat(np.eye(20) * largest)

    assert kept(notes)["draw"][0]["heat"] == bytes(np.eye(20, dtype=np.uint8) * 255)


def test_text_that_no_bytes_stand_for_is_kept_as_question_marks(notes: Annotations) -> None:
    notes.log("half \ud800")
    notes.draw.cell(1, 1, "red", "\ud800")
    notes.draw.path("\ud800")

    assert kept(notes)["log"] == [
        "half ?",
        "arena: a drawing was left out: ? is no cell; a cell is a row and a column",
    ]
    assert kept(notes)["draw"][0]["text"] == "?"


def test_a_path_that_fails_as_it_is_computed_costs_itself_alone(notes: Annotations) -> None:
    notes.draw.path((0, 1 // column) for column in (1, 0))

    assert kept(notes) == {"log": ["arena: a drawing was left out: it cannot be read (ZeroDivisionError)"], "draw": []}


def test_a_value_that_has_no_text_costs_its_line_alone(notes: Annotations) -> None:
    class Mute:
        def __str__(self) -> str:
            raise RuntimeError

    notes.log("before")
    notes.log("this is", Mute())

    assert kept(notes)["log"] == ["before", "arena: a line was left out: one of its values has no text (RuntimeError)"]


def test_drawings_off_the_board_without_end_leave_the_rest_readable(notes: Annotations) -> None:
    for row in range(3000):
        notes.draw.cell(20 + row, 0)
    notes.log("here")

    assert kept(notes)["log"][-1] == "here"
    assert len(notes.pack()) < MOST_BYTES


def test_a_log_without_end_is_cut_and_says_so(notes: Annotations) -> None:
    notes.log("x" * 1_000_000)
    for _ in range(1000):
        notes.log("more")

    log = kept(notes)["log"]
    assert [line[:20] for line in log] == ["x" * 20, "arena: the log of on"]
    assert "this line of 1000000 was cut" in log[1]


def test_drawings_without_end_are_left_out_and_a_line_says_so(notes: Annotations) -> None:
    for _ in range(10_000):
        notes.draw.heat(np.ones((20, 20)))
        notes.draw.path([(0, 0)] * 400)
        notes.draw.cell(1, 1)

    assert len(notes.pack()) < MOST_BYTES
    assert len(kept(notes)["log"]) == 1


def test_what_a_program_sends_is_noted_likewise(notes: Annotations) -> None:
    notes.add({"orders": [0], "log": ["a", 3], "draw": [{"heat": [[1] * 20] * 20}, "junk", {"path": [[0, 0]]}]})
    notes.add({"log": "alone", "draw": 7})

    assert kept(notes)["log"] == ["a", "3", "arena: a drawing was left out: it is no object with cell, path or heat", "alone"]
    assert [next(iter(drawing)) for drawing in kept(notes)["draw"]] == ["heat", "path"]


@pytest.mark.parametrize(
    "made_up",
    [
        [],
        {"log": []},
        {"log": [1], "draw": []},
        {"log": "text", "draw": []},
        {"log": [], "draw": 3},
        {"log": [], "draw": [3]},
        {"log": [], "draw": [{"cell": [99, 0], "colour": "red"}]},
        {"log": [], "draw": [{"cell": [0, 0], "colour": ["red"]}]},
        {"log": ["x" * 40_000], "draw": []},
    ],
)
def test_what_a_stranger_made_up_is_refused(made_up: Any) -> None:
    with pytest.raises(UnreadableError, match="annotations"):
        read_annotations(msgpack.packb(made_up), 20)
