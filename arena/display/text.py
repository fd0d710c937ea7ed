"""A board as a person reads it in a terminal: colours where there are any, letters always.

The letters are those of `arena.game.board`: capitals are blue's, small letters red's.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from arena.display.seat_memory import Mask
from arena.game.types import Code

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
Marks = dict[tuple[int, int], tuple[str, str]]
"""By (row, column): what stands there instead of the letter, empty for the letter itself, and a style over the cell's own."""


def letter_of(code: int) -> str:
    """Return the letter of a code of Table 2."""
    return _LOOKS[Code(code)][0]


def draw_board(grid: NDArray[np.int8], *, is_wide: bool, dimmed: Mask | None = None, marks: Marks | None = None) -> Text:
    """Return a Table 2 board of shape (side, side) as text; wide cells are two columns, and nearly square."""
    text = Text(no_wrap=True)
    for row, codes in enumerate(grid.tolist()):
        if row:
            text.append("\n")
        for column, code in enumerate(codes):
            letter, style = _LOOKS[Code(code)]
            is_dim = dimmed is not None and dimmed[row, column]
            shown, over = ("", "") if marks is None else marks.get((row, column), ("", ""))
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
