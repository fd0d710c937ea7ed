"""A board as a person reads it in a terminal: colours where there are any, letters always; and what befell a seat, in words.

The letters are those of `arena.game.board`: capitals are blue's, small letters red's.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from arena.game.observation import EnemyUnit, Observation, OwnUnit
from arena.game.types import Action, Code, Team, Termination

if TYPE_CHECKING:
    from arena.policy import MatchResult

_LOOKS = {
    Code.HIDDEN: (" ", "on grey7"),
    Code.BLUE_HALF: ("·", "grey42 on #10243f"),
    Code.RED_HALF: (":", "grey42 on #3d1a10"),
    Code.BLUE_UGV: ("U", "bold white on #2f7de1"),
    Code.BLUE_UAV: ("A", "bold #8fc1ff on #10243f"),
    Code.RED_UGV: ("u", "bold black on #ff9d4d"),
    Code.RED_UAV: ("a", "bold #ffb87a on #3d1a10"),
    Code.BLUE_FLAG: ("F", "bold #10243f on #8fc1ff"),
    Code.RED_FLAG: ("f", "bold #3d1a10 on #ffb87a"),
    Code.OBSTACLE: ("#", "grey50 on grey35"),
}
"""Letter and style of each code. Blue and orange are told apart by the colour-blind, and so are the letters."""
LEGEND = "U A F · blue   u a f : red   UGV UAV flag half   # obstacle"
_UNMARKED: dict[tuple[int, int], tuple[str, str]] = {}

Mask = NDArray[np.bool_]
"""bool, shape (side, side)."""


Marks = Mapping[tuple[int, int], tuple[str, str]]
"""By (row, column): what stands there instead of the letter, empty for the letter itself, and a style over the cell's own."""


def letter_of(code: int) -> str:
    """Return the letter of a code of Table 2."""
    return _LOOKS[Code(code)][0]


def draw_board(grid: NDArray[np.int8], *, is_wide: bool, dimmed: Mask | None = None, marks: Marks = _UNMARKED) -> Text:
    """Return a Table 2 board of shape (side, side) as text; wide cells are two columns, and nearly square."""
    text = Text(no_wrap=True)
    for row, codes in enumerate(grid.tolist()):
        if row:
            text.append("\n")
        for column, code in enumerate(codes):
            letter, style = _LOOKS[Code(code)]
            is_dim = dimmed is not None and dimmed[row, column]
            shown, over = marks.get((row, column), ("", ""))
            width = 2 if is_wide else 1
            text.append((shown or letter)[:width].ljust(width), f"{'dim ' if is_dim else ''}{style} {over}".rstrip())
    return text


def draw_row(
    title: str,
    boards: Sequence[tuple[str, NDArray[np.int8]]],
    width: int,
    *,
    height: int | None = None,
    dimmed: Mask | None = None,
    aside: str = "",
) -> Group:
    """Return boards side by side under a title, or one under the other where `width` does not hold them side by side.

    Parameters
    ----------
    height
        Lines of a screen that does not scroll: where the boards do not fit, the first stands alone, with a note.
    dimmed
        Cells of the last board that are shown dimmed.
    aside
        Lines that stand beside the boards where there is room, and under the title elsewhere.
    """
    side, gap, n_boards = len(boards[0][1]), 3, len(boards)
    is_wide = width >= n_boards * (2 * side + gap) - gap
    dims = [None] * (n_boards - 1) + [dimmed]
    drawn = [draw_board(grid, is_wide=is_wide, dimmed=dim) for (_, grid), dim in zip(boards, dims, strict=True)]
    labels = [Text(label, "bold") for label, _ in boards]
    least_width = n_boards * (side + gap) - gap
    if width < least_width:
        if height is not None and height < 1 + n_boards * (side + 1):
            others = " and ".join(label for label, _ in boards[1:])
            return Group(Text(title), labels[0], drawn[0], Text(f"{others}: from {least_width} columns on", "italic"))
        return Group(Text(title), *(part for pair in zip(labels, drawn, strict=True) for part in pair))
    table = Table.grid(padding=(0, gap, 0, 0))
    beside = width - n_boards * ((2 if is_wide else 1) * side + gap) >= max(map(len, aside.splitlines()), default=0) > 0
    table.add_row(*labels, *([Text("")] if beside else []))
    table.add_row(*drawn, *([Text(aside)] if beside else []))
    return Group(Text(title if beside or not aside else f"{title}\n{aside}"), table)


def is_live(console: Console) -> bool:
    """Whether one frame can be drawn over the other: on a terminal that is more than a typewriter."""
    return console.is_terminal and not console.is_dumb_terminal


class GroundMemory:
    """The ground as one seat saw it last, from tick to tick."""

    def __init__(self, side: int) -> None:
        self._ground = np.full((side, side), Code.HIDDEN, np.int8)

    def recall(self, seen: Observation) -> tuple[NDArray[np.int8], Mask]:
        """Return what the seat sees with the ground that it remembers behind it, and where that is memory alone."""
        self._ground = np.where(seen.ground == Code.HIDDEN, self._ground, seen.ground)
        grid = seen.grid
        is_hidden = grid == Code.HIDDEN
        return np.where(is_hidden, self._ground, grid), is_hidden


def name_order(order: int) -> str:
    """Return an order, a byte as transcripts and journals hold it, as a word."""
    return Action(order).name.lower() if order in tuple(Action) else "nothing"


def name_unit(unit: OwnUnit) -> str:
    """Return a unit's type and number."""
    return f"{unit.type} {unit.index}"


def format_losses(seen: Sequence[Observation]) -> Iterator[str]:
    """Yield a line for each own unit that fell, with the enemies in sight when it was last told, and one on all sightings."""
    for before, after in pairwise(seen):
        for old, new in zip(before.units, after.units, strict=True):
            if old.alive and not new.alive:
                yield f"tick {after.tick}: {name_unit(new)} fell at {_place(new)}; in sight before: {_list(before.enemies)}"
    yield f"enemies were in sight at {_spans([one.tick for one in seen if one.enemies])}"


def format_last_tick(seen: Sequence[Observation], result: "MatchResult") -> str:
    """Return what the last tick changed, of which a seat is shown nothing: its last observation is of the tick before."""
    if result.ending in (Termination.FORFEIT, Termination.VOID):
        return f"the pit ruled: {result.reason or 'no reason given'}"
    if not seen:
        return "nothing was seen of this match"
    last, when = seen[-1], f"in tick {result.ticks}"
    won, lost = result.winner in (None, last.team), result.winner in (None, last.team.other)
    parts = []
    if result.ending is Termination.CAPTURE:
        if lost:
            parts.append(f"the own flag{_flag(seen, last.team)} was captured; {_captor(seen)}")
        if won:
            parts.append(f"the enemy's flag{_flag(seen, last.team.other)} was captured")
    elif result.ending is Termination.ELIMINATION:
        if lost:
            fallen = [unit for unit in last.units if unit.alive and not unit.flies]
            parts.append(f"the last own units fell: {_list(fallen)}; in sight before: {_list(last.enemies)}")
        if won:
            parts.append("the last enemy units fell")
    else:
        own, enemy = last.living
        change = "stayed at" if result.score == last.score else f"went from {last.score:+d} to"
        parts.append(f"the tick limit came, the score {change} {result.score:+d}; {own} own and {enemy} enemy units lived before")
    if last.tick + 1 < result.ticks:
        parts.append(f"the last that the seat was shown is tick {last.tick}")
    return f"{when} {'; '.join(parts)}"


def _place(unit: OwnUnit | EnemyUnit) -> str:
    return f"({unit.row}, {unit.column})"


def _list(units: Sequence[OwnUnit | EnemyUnit]) -> str:
    named = ((name_unit(unit) if isinstance(unit, OwnUnit) else unit.type, _place(unit)) for unit in units)
    return ", ".join(f"{name} at {place}" for name, place in named) or "nobody"


def _find_flag(seen: Sequence[Observation], team: Team) -> tuple[int, int] | None:
    return next((place for one in seen if (place := one.find_flag(team)) is not None), None)


def _flag(seen: Sequence[Observation], team: Team) -> str:
    place = _find_flag(seen, team)
    return ", which was never in sight," if place is None else f" at {place}"


def _captor(seen: Sequence[Observation]) -> str:
    """Return who stood a step from the own flag in the last observation."""
    place = _find_flag(seen, seen[-1].team)
    walkers = [unit for unit in seen[-1].enemies if not unit.flies]
    beside = [] if place is None else [one for one in walkers if abs(one.row - place[0]) + abs(one.column - place[1]) <= 1]
    return f"in sight beside it before: {_list(beside)}"


def _spans(ticks: Sequence[int]) -> str:
    """Return ticks as spans: "ticks 3 to 7, 9"."""
    known = set(ticks)
    starts, ends = ([tick for tick in ticks if tick + step not in known] for step in (-1, 1))
    spans = [str(start) if start == end else f"{start} to {end}" for start, end in zip(starts, ends, strict=True)]
    return f"{'tick' if len(known) == 1 else 'ticks'} {', '.join(spans)}" if spans else "no tick"
