"""What a bot drew over its board (`arena.annotations`), for a terminal: marks with colours, and letters where there are none."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.console import clean
from arena.display.text import Marks
from arena.game.types import HALVES, Code

_COLOURS = {
    "red": "#c62828", "orange": "#ef6c00", "yellow": "#f9a825", "green": "#2e7d32", "blue": "#1565c0", "purple": "#6a1b9a",
    "black": "#000000", "white": "#fafafa",
}  # fmt: skip
_DARK_LETTERS = {"orange", "yellow", "white"}
"""Colours on which black reads better than white."""
_N_SHADES = 8
_GAP = 2
"""Columns between boards of letters."""
_EMPTY = (Code.HIDDEN, *HALVES)


def mark_drawings(marks: Marks, drawings: Sequence[Mapping[str, Any]], grid: NDArray[np.int8], cell_columns: int) -> None:
    """Add drawings to the marks of a board, each over those before it: heat as shades, cells in colour, paths as dots.

    Where heats lie over each other, a cell has the colour of the strongest.
    """
    strongest: dict[tuple[int, int], float] = {}
    for drawing in drawings:
        colour = drawing["colour"]
        hex_colour = _COLOURS[colour]
        for row, column, shade in _shaded_cells(drawing, len(grid)):
            if grid[row, column] not in (*_EMPTY, Code.OBSTACLE):  # units and flags keep the colours of their team
                continue
            if shade < strongest.get((row, column), 0.0):
                continue
            strongest[row, column] = shade
            text, style = marks.get((row, column), ("", ""))
            marks[row, column] = text, f"{style} on {_darken(hex_colour, shade)}".strip()
        if "cell" in drawing:
            row, column = drawing["cell"]
            text, style = marks.get((row, column), ("", ""))
            letters = drawing["text"][:cell_columns] if drawing["text"].isprintable() else ""
            marks[row, column] = letters or text, f"{'black' if colour in _DARK_LETTERS else 'white'} on {hex_colour}"
        for row, column in drawing.get("path", ()):
            text, style = marks.get((row, column), ("", ""))
            is_empty = not text and grid[row, column] in _EMPTY
            marks[row, column] = ("•", f"{style} bold {hex_colour}".strip()) if is_empty else (text, f"{style} underline".strip())


def list_labels(drawings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the labels of the heats that have one, each once."""
    return list(dict.fromkeys(drawing["label"] for drawing in drawings if "label" in drawing))


def keep_heat(drawings: Sequence[Mapping[str, Any]], label: str) -> list[Mapping[str, Any]]:
    """Return drawings without the heats that have another label; all of them if `label` is empty."""
    return [drawing for drawing in drawings if drawing.get("label", label) == label or not label]


def write_drawings(drawings: Sequence[Mapping[str, Any]], side: int, width: int) -> list[str]:
    """Return drawings as lines of letters, for where there are no colours: a board for each label, the others on one before them.

    Boards stand side by side where `width` columns hold them. The text of a cell stands there, or `*`, `.` for a path, and 1 to 9
    for heat.
    """
    plain, labels = [drawing for drawing in drawings if "label" not in drawing], list_labels(drawings)
    alone = [[drawing for drawing in drawings if drawing.get("label") == label] for label in labels]
    boards = [["drawn:", *_write_board(plain, side)]] if plain else []
    boards += [[f"{clean(label)}:", *_write_board(heats, side)] for label, heats in zip(labels, alone, strict=True)]
    n_columns = max((len(line) for board in boards for line in board), default=0) + _GAP
    n_beside = max((width + _GAP) // n_columns, 1)
    rows = [boards[at : at + n_beside] for at in range(0, len(boards), n_beside)]
    return ["".join(part.ljust(n_columns) for part in line).rstrip() for row in rows for line in zip(*row, strict=True)]


def _write_board(drawings: Sequence[Mapping[str, Any]], side: int) -> list[str]:
    letters = [["-"] * side for _ in range(side)]
    for drawing in drawings:
        for row, column, shade in _shaded_cells(drawing, side):
            letters[row][column] = str(max(round(shade * 9), 1))
        for row, column in drawing.get("path", ()):
            letters[row][column] = "."
        if "cell" in drawing:
            row, column = drawing["cell"]
            first = drawing["text"][:1]
            letters[row][column] = first if first.isprintable() and first.strip() else "*"
    return ["".join(row) for row in letters]


def _shaded_cells(drawing: Mapping[str, Any], side: int) -> Iterator[tuple[int, int, float]]:
    """Yield row, column and shade, above 0 and up to 1, of the cells that a heat colours."""
    for cell, value in enumerate(drawing.get("heat", b"")):
        if value:
            yield *divmod(cell, side), -(-value * _N_SHADES // 255) / _N_SHADES


def _darken(colour: str, shade: float) -> str:
    return "#" + "".join(f"{round(int(colour[at : at + 2], 16) * shade):02x}" for at in (1, 3, 5))
