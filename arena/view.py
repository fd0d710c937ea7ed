"""A board as a person reads it in a terminal: colours where there are any, letters always; and what befell a seat, in words.

The letters are those of `arena.game.board`: capitals are blue's, small letters red's.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.console import Group
from rich.table import Table
from rich.text import Text

from arena.game.types import Action, Code, Ending, Team
from arena.observation import EnemyUnit, Observation, OwnUnit

if TYPE_CHECKING:
    from arena.policy import MatchResult

_LOOKS = {
    Code.HIDDEN: (" ", "on grey7"),
    Code.BLUE_HALF: ("·", "grey42 on #10243f"),
    Code.RED_HALF: ("·", "grey42 on #3d1a10"),
    Code.BLUE_UGV: ("U", "bold white on #2f7de1"),
    Code.BLUE_UAV: ("A", "bold #8fc1ff on #10243f"),
    Code.RED_UGV: ("u", "bold black on #ff9d4d"),
    Code.RED_UAV: ("a", "bold #ffb87a on #3d1a10"),
    Code.BLUE_FLAG: ("F", "bold #10243f on #8fc1ff"),
    Code.RED_FLAG: ("f", "bold #3d1a10 on #ffb87a"),
    Code.OBSTACLE: ("#", "grey50 on grey35"),
}
"""Letter and style of each code. Blue and orange are told apart by the colour-blind, and so are the letters."""
LEGEND = "U A F blue   u a f red   UGV UAV flag   # obstacle"


Mask = NDArray[np.bool_]
"""bool, shape (side, side)."""


def draw_board(grid: NDArray[np.int8], *, is_wide: bool, dimmed: Mask | None = None) -> Text:
    """Return a Table 2 board of shape (side, side) as text; wide cells are two columns, and nearly square."""
    text = Text(no_wrap=True)
    for row, codes in enumerate(grid.tolist()):
        if row:
            text.append("\n")
        for column, code in enumerate(codes):
            letter, style = _LOOKS[Code(code)]
            is_dim = dimmed is not None and dimmed[row, column]
            text.append(f"{letter} " if is_wide else letter, f"dim {style}" if is_dim else style)
    return text


def draw_pair(
    title: str, left: tuple[str, NDArray[np.int8]], right: tuple[str, NDArray[np.int8]], width: int, *, dimmed: Mask | None = None
) -> Group:
    """Return two boards side by side under a title, as in the paper's Figure 2, narrow enough for `width` columns.

    Parameters
    ----------
    dimmed
        Cells of the right board that are shown dimmed.
    """
    return draw_row(title, [left, right], width, dimmed=dimmed)


def draw_row(title: str, boards: Sequence[tuple[str, NDArray[np.int8]]], width: int, *, dimmed: Mask | None = None) -> Group:
    """Return boards side by side under a title; `dimmed` is of the last."""
    side, gap = len(boards[0][1]), 3
    is_wide = width >= len(boards) * (2 * side + gap) - gap
    table = Table.grid(padding=(0, gap, 0, 0))
    table.add_row(*(Text(label, "bold") for label, _ in boards))
    dims = [None] * (len(boards) - 1) + [dimmed]
    table.add_row(*(draw_board(grid, is_wide=is_wide, dimmed=dim) for (_, grid), dim in zip(boards, dims, strict=True)))
    return Group(Text(title), table)


class Memory:
    """The ground as one seat saw it last, from tick to tick."""

    def __init__(self, side: int) -> None:
        self._ground = np.full((side, side), Code.HIDDEN, np.int8)

    def draw_pair(self, title: str, seen: Observation, width: int) -> Group:
        """Return what the seat sees, and beside it the same with the ground that it remembers, dimmed."""
        self._ground = np.where(seen.ground == Code.HIDDEN, self._ground, seen.ground)
        grid = seen.grid
        is_hidden = grid == Code.HIDDEN
        known = np.where(is_hidden, self._ground, grid)
        return draw_pair(title, (f"what {seen.team.name.lower()} sees", grid), ("and remembers", known), width, dimmed=is_hidden)


def tell_orders(seen: Observation, orders: bytes) -> str:
    """Return what each unit was told; `orders` is a byte per unit."""
    words = {int(action): action.name.lower() for action in Action}
    told = zip(seen.units, orders, strict=True)
    return ", ".join(f"{_name(unit)} {words.get(order, 'nothing') if unit.alive else 'fallen'}" for unit, order in told)


def tell_losses(seen: Sequence[Observation]) -> Iterator[str]:
    """Yield a line for each own unit that fell, with the enemies in sight when it was last told, and one on all sightings."""
    for before, after in pairwise(seen):
        for old, new in zip(before.units, after.units, strict=True):
            if old.alive and not new.alive:
                yield f"tick {after.tick}: {_name(new)} fell at {_place(new)}; in sight before: {_list(before.enemies)}"
    yield f"enemies were in sight at {_spans([one.tick for one in seen if one.enemies])}"


def tell_end(seen: Sequence[Observation], result: "MatchResult") -> str:
    """Return what the last tick changed, of which a seat is shown nothing: its last observation is of the tick before."""
    if result.ending in (Ending.FORFEIT, Ending.VOID):
        return f"the pit ruled: {result.reason or 'no reason given'}"
    if not seen:
        return "nothing was seen of this match"
    last, when = seen[-1], f"in tick {result.ticks}"
    won, lost = result.winner in (None, last.team), result.winner in (None, last.team.other)
    parts = []
    if result.ending is Ending.CAPTURE:
        if lost:
            parts.append(f"the own flag{_flag(seen, last.team)} was captured; {_captor(seen)}")
        if won:
            parts.append(f"the enemy's flag{_flag(seen, last.team.other)} was captured")
    elif result.ending is Ending.ELIMINATION:
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


def tell_result(team: Team, result: "MatchResult") -> str:
    """Return how a match ended for one team; `result.score` is its own."""
    how = result.ending.name.lower().replace("_", " ")
    if result.ending is Ending.VOID:
        return f"void after {result.ticks} ticks, for {team.name.lower()} as for the other"
    outcome = "drawn" if result.winner is None else "won" if result.winner is team else "lost"
    return f"{outcome} as {team.name.lower()} by {how} after {result.ticks} ticks, own score {result.score:+d}"


def _name(unit: OwnUnit) -> str:
    return f"{unit.type} {unit.index}"


def _place(unit: OwnUnit | EnemyUnit) -> str:
    return f"({unit.row}, {unit.column})"


def _list(units: Sequence[OwnUnit | EnemyUnit]) -> str:
    named = ((_name(unit) if isinstance(unit, OwnUnit) else unit.type, _place(unit)) for unit in units)
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
