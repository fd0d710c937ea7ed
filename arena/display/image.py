"""A match as pictures, for papers and talks: the two boards of the paper's Figure 2, and beside the caption what just happened.

Teams differ in colour and in shape: blue's units are round, red's are square, those that fly are hollow. Blue and orange are
told apart by the colour-blind, and the shapes in print.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from arena.console import clean
from arena.display.seat_memory import GroundMemory, find_losses
from arena.errors import InputError
from arena.game.engine import BatchedGame
from arena.game.state import StateField
from arena.game.types import FLAGS, UAVS, UGVS, Code, Team
from arena.records.journal import Journal
from arena.records.replay import replay
from arena.records.transcript import Transcript

Cell = tuple[int, int]
"""(row, column)."""
Grid = NDArray[np.int8]

_PAPER, _INK, _FAINT = "#ffffff", "#1a1a1a", "#8a8a8a"
_GROUND = {Code.HIDDEN: "#55585e", Code.OBSTACLE: "#1f2125"}
_TINTS = ("#dbe9fb", "#fdeadb")
_TEAMS = ("#1f6fd6", "#e07b1a")
_DARK = ("#0b2c58", "#6b3200")
_HIT = "#c2185b"
"""Of fights; neither team's, and darker than both grounds."""
_LEGEND = ("round: blue", "square: red", "hollow: flies", "pennant: flag", "black: obstacle", "grey: not seen")
_MARKS = ("crimson frame: fought", "cross: fell", "black frame: captured")
"""Of the legend, where things are marked."""
_FADED = "faded: remembered"
_MOST_LETTERS = 200
"""Of a title: in a file that a stranger made, a name may be a megabyte long, and drawn it would take minutes."""
_MEMORY = 0.45
"""How far a cell that is only remembered fades towards the colour of the hidden."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageFrame:
    """What one picture shows."""

    title: str
    caption: str
    boards: tuple[tuple[str, Grid], tuple[str, Grid]]
    """The label of each board, and its cells in the codes of Table 2."""
    faded: NDArray[np.bool_] | None = None
    """bool, shape (side, side): cells of the right board that are remembered, and not seen."""
    fought: frozenset[Cell] = frozenset()
    """Cells of units that fought in this tick and live. Fights, falls and captures are marked on the right board."""
    fallen: frozenset[Cell] = frozenset()
    """Cells where units fell in this tick."""
    captured: frozenset[Cell] = frozenset()
    """Cells of flags that were captured in this tick."""


def last_tick(recording: Journal | Transcript) -> int:
    """Return the number of the last tick that there is a frame of; -1 if there is none."""
    return len(recording.ticks) - isinstance(recording, Transcript)


def frames_of(recording: Journal | Transcript, team: Team | None) -> Iterator[ImageFrame]:
    """Return the frame of every tick; `team` is whose view of a journal, blue's without it."""
    if isinstance(recording, Transcript):
        return _of_transcript(recording)
    return _of_journal(recording, Team.BLUE if team is None else team)


def _of_journal(journal: Journal, team: Team) -> Iterator[ImageFrame]:
    header, limit = journal.header, journal.header.ruleset.tick_limit
    for games in replay(journal):
        field, events = games.state.field[0], games.events
        yield ImageFrame(
            title=f"blue {header.blue} against red {header.red}",
            caption=f"tick {field[StateField.TICK]} of {limit}   score {field[StateField.SCORE]:+d} for blue   "
            f"units {field[StateField.BLUE_LIVING]}:{field[StateField.RED_LIVING]}",
            boards=((f"what {team.name.lower()} sees", games.grids()[team, 0]), ("the truth", games.truth(0))),
            fought=_cells(games, events.fought & ~events.fell),
            fallen=_cells(games, events.fell),
            captured=_cells(games, events.captured),
        )


def _of_transcript(transcript: Transcript) -> Iterator[ImageFrame]:
    header, memory = transcript.header, GroundMemory(transcript.header.ruleset.side)
    own = header.team.name.lower()
    before = None
    for seen in transcript.observations():
        known, is_faded = memory.recall(seen)
        own_living, enemy_living = seen.living
        yield ImageFrame(
            title=f"{header.name} plays {own} against {header.opponent}",
            caption=f"tick {seen.tick} of {header.ruleset.tick_limit}   score {seen.score:+d}   "
            f"units {own_living}:{enemy_living}",
            boards=((f"what {own} sees", seen.grid), ("and remembers", known)),
            faded=is_faded,
            fallen=frozenset((unit.row, unit.column) for unit in find_losses(before, seen)),
        )
        before = seen


def _cells(games: BatchedGame, flags: NDArray[np.bool_]) -> frozenset[Cell]:
    """Return where the flagged units of the first game stand, or fell."""
    return frozenset(divmod(cell, games.ruleset.side) for cell in games.state.cell[0, flags[0]].tolist())


def draw(frame: ImageFrame, cell: int) -> Image.Image:
    """Return a frame as a picture, each cell `cell` pixels wide."""
    side = len(frame.boards[0][1])
    board, gap, line = side * cell, cell, max(cell, 12)
    top = gap + 3 * line
    font, small = (ImageFont.load_default(size=line * share) for share in (0.8, 0.7))
    legend = _wrap((*_LEGEND, _FADED) if frame.faded is not None else (*_LEGEND, *_MARKS), small, 2 * board + gap)
    image = Image.new("RGB", (2 * board + 3 * gap, top + board + gap + len(legend) * line), _PAPER)
    pen = ImageDraw.Draw(image)
    pen.text((gap, gap * 0.6), clean(frame.title[:_MOST_LETTERS]), fill=_INK, font=font)
    pen.text((gap, gap * 0.6 + line), frame.caption, fill=_INK, font=font)
    for number, (label, grid) in enumerate(frame.boards):
        at = gap + number * (board + gap)
        pen.text((at, gap * 0.7 + 2 * line), label, fill=_FAINT, font=font)
        _draw_board(pen, grid, frame.faded if number else None, at, top, cell)
        if number:
            _draw_marks(pen, frame, at, top, cell)
    for number, words in enumerate(legend):
        pen.text((gap, top + board + gap * 0.3 + number * line), words, fill=_FAINT, font=small)
    return image


def _wrap(parts: Sequence[str], font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> list[str]:
    """Return the parts of a legend in as many lines as they need."""
    lines: list[str] = []
    for part in parts:
        longer = f"{lines[-1]}   {part}" if lines else part
        if lines and font.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(part)
    return lines


def _draw_board(pen: ImageDraw.ImageDraw, grid: Grid, faded: NDArray[np.bool_] | None, left: int, top: int, cell: int) -> None:
    side = len(grid)
    for row in range(side):
        for column in range(side):
            code = Code(int(grid[row, column]))
            is_faded = faded is not None and bool(faded[row, column])
            box = left + column * cell, top + row * cell, left + (column + 1) * cell - 2, top + (row + 1) * cell - 2
            half = _half_of(grid, row, column)
            colour = _GROUND.get(code) or _TINTS[half]
            pen.rectangle(box, fill=_blend(colour, _GROUND[Code.HIDDEN]) if is_faded else colour)
            _draw_piece(pen, code, box)
    pen.rectangle((left - 1, top - 1, left + side * cell - 1, top + side * cell - 1), outline=_INK)


def _half_of(grid: Grid, row: int, column: int) -> Team:
    """Return whose half a cell lies on: units hide it, so the columns of the half that are seen say so."""
    codes = grid[:, : len(grid) // 2] if column < len(grid) // 2 else grid[:, len(grid) // 2 :]
    blue, red = (int(np.count_nonzero(codes == code)) for code in (Code.BLUE_HALF, Code.RED_HALF))
    return Team.BLUE if blue >= red else Team.RED


def _draw_piece(pen: ImageDraw.ImageDraw, code: Code, box: tuple[int, int, int, int]) -> None:
    left, top, right, bottom = box
    pad = max((right - left) // 7, 1)
    inner = left + pad, top + pad, right - pad, bottom - pad
    for team in Team:
        if code in (UGVS[team], UAVS[team]):
            shape = pen.ellipse if team is Team.BLUE else pen.rectangle
            width = max((right - left) // 6, 1)
            flies = code == UAVS[team]
            shape(
                inner,
                fill=_PAPER if flies else _TEAMS[team],
                outline=_TEAMS[team] if flies else _DARK[team],
                width=width if flies else 1,
            )
        elif code == FLAGS[team]:
            pole = left + pad * 2
            pen.polygon(
                ((pole, top + pad), (right - pad, (2 * top + bottom) // 3), (pole, (top + bottom) // 2 + pad)), fill=_TEAMS[team]
            )
            pen.line((pole, top + pad, pole, bottom - pad), fill=_DARK[team], width=max(pad // 2, 1))


def _draw_marks(pen: ImageDraw.ImageDraw, frame: ImageFrame, left: int, top: int, cell: int) -> None:
    width = max(cell // 6, 2)
    for cells in (frame.fought, frame.fallen, frame.captured):
        for row, column in cells:
            box = left + column * cell - 2, top + row * cell - 2, left + (column + 1) * cell, top + (row + 1) * cell
            if cells is frame.fallen:
                pen.line(box, fill=_HIT, width=width)
                pen.line((box[0], box[3], box[2], box[1]), fill=_HIT, width=width)
            else:
                pen.rectangle(box, outline=_HIT if cells is frame.fought else _INK, width=width)


def _blend(colour: str, towards: str) -> str:
    mixed = (round(int(colour[at : at + 2], 16) * (1 - _MEMORY) + int(towards[at : at + 2], 16) * _MEMORY) for at in (1, 3, 5))
    return "#" + "".join(f"{part:02x}" for part in mixed)


def save_png(image: Image.Image, path: Path) -> None:
    """Write one picture; `InputError` if it cannot be written."""
    try:
        image.save(path, format="PNG", optimize=True)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error


def save_gif(images: Sequence[Image.Image], path: Path | BytesIO, ticks_per_s: float) -> None:
    """Write moving pictures to a file or into memory, the last of them for longer; `InputError` if they cannot be written.

    GIF counts in hundredths of a second.
    """
    shown_ms = round(100 / ticks_per_s) * 10
    durations = [shown_ms] * (len(images) - 1) + [max(shown_ms, 2000)]
    palette = [image.quantize(colors=64, dither=Image.Dither.NONE) for image in images]
    try:
        palette[0].save(path, format="GIF", save_all=True, append_images=palette[1:], duration=durations, loop=0)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error
