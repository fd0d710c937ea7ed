"""What a bot notes beside its orders: text, and drawings over its board. For its author's eyes; the pit never gets it.

A bot writes `observation.log("flag at", flag)`, `observation.draw.cell(3, 4, "red", "A")`, `.path(cells)` and `.heat(array)`. Who
plays the bot decides whether anything is kept (`BatchPolicy.keeps_annotations`). The notes of one tick, as transcripts hold them:

    {"log": ["flag at (3, 4)"],
     "draw": [{"cell": [3, 4], "colour": "red", "text": "A"},
              {"path": [[3, 4], [3, 5]], "colour": "yellow"},
              {"heat": bytes, "colour": "blue", "label": "their flag"}]}

`heat` is a byte per cell, row by row: 0 is nothing, 255 the highest value. Where several have a `label`, whoever looks at them
can choose one. A drawing that cannot be kept, and what is too long, costs nobody a tick: a line of the log says so instead.
"""

from collections.abc import Iterable, Iterator, Mapping
from operator import index
from typing import Any

import msgpack
import numpy as np

from arena.errors import UnreadableError

COLOURS = ("red", "orange", "yellow", "green", "blue", "purple", "black", "white")
MOST_BYTES = 1 << 14
"""Of one tick's annotations, packed."""
_MOST_LETTERS = 4_000
"""Of one tick's log."""
_MOST_CELL_LETTERS, _MOST_LABEL_LETTERS = 3, 20
_OVERHEAD_BYTES = 32
"""Of one line or drawing, beside what it holds."""
_OURS = "arena: "
"""Stands before the lines that the arena writes into a log."""
_MOST_SAID, _MOST_SAID_LETTERS = 8, 200
"""Of the arena's own lines in one tick's log."""


class _UnfitError(ValueError):
    """A drawing that cannot be kept, in a few words."""


class Pen:
    """Draws over the board of one tick; colours are those of `COLOURS`. Without a page to draw on, nothing happens."""

    def __init__(self, page: "Annotations | None") -> None:
        self._page = page

    def cell(self, row: int, column: int, colour: str = "yellow", text: str = "") -> None:
        """Colour a cell, and write up to three letters into it."""
        if self._page is not None:
            self._page.add_drawing({"cell": (row, column), "colour": colour, "text": text})

    def path(self, cells: Iterable[tuple[int, int]], colour: str = "yellow") -> None:
        """Draw a line through the centres of cells, each (row, column)."""
        if self._page is not None:
            self._page.add_drawing({"path": cells, "colour": colour})

    def heat(self, values: Any, colour: str = "red", label: str = "") -> None:
        """Shade the board by an array of numbers, shape (side, side): nothing at 0 and below, full at the largest.

        A label of up to twenty letters tells one of several from the others.
        """
        if self._page is not None:
            self._page.add_drawing({"heat": values, "colour": colour, "label": label})


NO_PEN = Pen(None)


class Annotations:
    """What a bot notes on one tick, on a board of `side` by `side` cells."""

    def __init__(self, side: int) -> None:
        self.draw = Pen(self)
        self._side = side
        self._log: list[str] = []
        self._drawings: list[dict[str, Any]] = []
        self._n_letters = self._n_bytes = 0
        self._said: list[str] = []

    @property
    def is_whole(self) -> bool:
        """Whether nothing was cut or left out so far."""
        return not self._said and self._n_letters < _MOST_LETTERS

    def log(self, *values: object) -> None:
        """Keep a line of text, made of `values` as `print` would."""
        try:
            line = " ".join(map(str, values))
        except Exception as error:  # noqa: BLE001 - whoever made the values chose what their `__str__` does
            self._say_once(f"a line was left out: one of its values has no text ({type(error).__name__})")
            return
        left = _MOST_LETTERS - self._n_letters
        if left <= 0:
            return
        self._n_letters += len(line) + 1
        if len(line) > left:
            self._log.append(_encodable(line[:left]))
            self._say(f"the log of one tick has room for {_MOST_LETTERS} letters, so this line of {len(line)} was cut")
        else:
            self._log.append(_encodable(line))

    def add_drawing(self, drawing: Mapping[str, Any]) -> None:
        """Keep a drawing that is given as one of the module's dictionaries; `heat` may be any array."""
        try:
            read = _read_drawing(drawing, self._side)
        except _UnfitError as error:
            self._say_once(f"a drawing was left out: {error}")
            return
        except Exception as error:  # noqa: BLE001 - its values may be of any kind, and a path may be computed as it is read
            self._say_once(f"a drawing was left out: it cannot be read ({type(error).__name__})")
            return
        n_bytes = _OVERHEAD_BYTES + max(len(read.get("heat", b"")), 8 * len(read.get("path", ()))) + len(read.get("label", ""))
        if self._n_bytes + n_bytes > MOST_BYTES // 2:
            self._say_once(f"the drawings of one tick have room for {MOST_BYTES // 2} bytes; the rest was left out")
            return
        self._n_bytes += n_bytes
        self._drawings.append(read)

    def add(self, notes: Mapping[str, Any]) -> None:
        """Keep what a program sent: its lines under `log`, a text or a list, and its drawings under `draw`, a list."""
        lines, drawings = notes.get("log", []), notes.get("draw", [])
        for line in [lines] if isinstance(lines, str) else lines if isinstance(lines, list) else []:
            self.log(line)
        for drawing in drawings if isinstance(drawings, list) else []:
            if isinstance(drawing, dict):
                self.add_drawing(drawing)
            else:
                self._say_once("a drawing was left out: it is no object with cell, path or heat")

    def to_dict(self) -> dict[str, Any]:
        """Return the annotations as plain data, as the module shows it."""
        return {"log": self._log, "draw": self._drawings}

    def pack(self) -> bytes:
        """Return the annotations as bytes for `read_annotations`; none if there is nothing."""
        return bytes(msgpack.packb(self.to_dict())) if self._log or self._drawings else b""

    def _say_once(self, sentence: str) -> None:
        sentence = sentence[:_MOST_SAID_LETTERS]
        if len(self._said) < _MOST_SAID and sentence not in self._said:
            self._said.append(sentence)
            self._say(sentence)

    def _say(self, sentence: str) -> None:
        self._log.append(_OURS + _encodable(sentence))
        self._n_letters += len(sentence)


def read_annotations(data: bytes, side: int) -> dict[str, Any]:
    """Return what `Annotations.pack` wrote, as plain data.

    Raises
    ------
    UnreadableError
        A stranger wrote something else.
    """
    if not data:
        return {"log": [], "draw": []}
    if len(data) > MOST_BYTES * 2:  # its letters may take several bytes each
        raise UnreadableError(f"the annotations of one tick have {len(data)} bytes")
    try:
        notes = msgpack.unpackb(data)
        log, drawings = notes["log"], notes["draw"]
        if not (isinstance(log, list) and all(isinstance(line, str) for line in log)):
            raise _UnfitError("a log that is no text")
        return {"log": log, "draw": [_read_drawing(drawing, side) for drawing in drawings]}
    except (_UnfitError, ValueError, KeyError, TypeError, msgpack.UnpackException) as error:
        raise UnreadableError(f"the annotations cannot be read: {error}") from error


def _encodable(text: str) -> str:
    """Return a text without the halves of letters that no bytes stand for, as JSON can make them."""
    return text.encode("utf-8", "replace").decode()


def _read_drawing(drawing: Mapping[str, Any], side: int) -> dict[str, Any]:
    """Return a drawing as it is kept; `_UnfitError` if it cannot be."""
    if not isinstance(drawing, Mapping):
        raise _UnfitError("it is no drawing")
    colour = drawing.get("colour", "yellow")
    if not isinstance(colour, str) or colour not in COLOURS:
        raise _UnfitError(f"there is no colour {str(colour)[:20]!r}, only {', '.join(COLOURS)}")
    match drawing:
        case {"cell": cell}:
            text = _encodable(str(drawing.get("text", ""))[:_MOST_CELL_LETTERS])
            return {"cell": _read_cell(cell, side), "colour": colour, "text": text}
        case {"path": cells}:
            return {"path": list(_read_cells(cells, side)), "colour": colour}
        case {"heat": values}:
            label = _encodable(str(drawing.get("label", ""))[:_MOST_LABEL_LETTERS])
            heat = values if _is_packed_heat(values, side) else _shade(values, side)
            return {"heat": heat, "colour": colour, **({"label": label} if label else {})}
    raise _UnfitError("it has no cell, no path and no heat")


def _read_cell(cell: Any, side: int) -> list[int]:
    try:
        row, column = map(index, cell)
    except TypeError:
        raise _UnfitError(f"{str(cell)[:40]} is no cell; a cell is a row and a column") from None
    except ValueError:
        raise _UnfitError("a cell is a row and a column") from None
    if not (0 <= row < side and 0 <= column < side):
        raise _UnfitError(f"row {row}, column {column} lies off the board of {side} by {side}")
    return [row, column]


def _read_cells(cells: Any, side: int) -> Iterator[list[int]]:
    try:
        every = iter(cells)
    except TypeError:
        raise _UnfitError("a path is a list of cells") from None
    for number, cell in enumerate(every):
        if number == side * side:
            raise _UnfitError(f"a path has {side * side} cells at most")
        yield _read_cell(cell, side)


def _is_packed_heat(values: Any, side: int) -> bool:
    return isinstance(values, bytes) and len(values) == side * side


def _shade(values: Any, side: int) -> bytes:
    """Return numbers as a byte per cell."""
    try:
        given = np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise _UnfitError("heat is an array of numbers") from None
    if given.size != side * side:
        raise _UnfitError(f"heat has shape {given.shape}, and the board is {side} by {side}")
    heat = np.maximum(np.nan_to_num(given.ravel(), nan=0.0, posinf=0.0, neginf=0.0), 0.0)
    most = heat.max(initial=0.0)
    return bytes(np.ceil(heat / most * 255).astype(np.uint8)) if most > 0 else bytes(side * side)
