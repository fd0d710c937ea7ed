"""A board as a person reads it in a terminal: colours where there are any, letters always.

The letters are those of `arena.game.board`: capitals are blue's, small letters red's.
"""

import numpy as np
from numpy.typing import NDArray
from rich.console import Group
from rich.table import Table
from rich.text import Text

from arena.game.types import Code

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


def draw_board(grid: NDArray[np.int8], *, is_wide: bool) -> Text:
    """Return a Table 2 board of shape (side, side) as text; wide cells are two columns, and nearly square."""
    text = Text(no_wrap=True)
    for row, codes in enumerate(grid.tolist()):
        if row:
            text.append("\n")
        for code in codes:
            letter, style = _LOOKS[Code(code)]
            text.append(f"{letter} " if is_wide else letter, style)
    return text


def draw_pair(title: str, left: tuple[str, NDArray[np.int8]], right: tuple[str, NDArray[np.int8]], width: int) -> Group:
    """Return two boards side by side under a title, as in the paper's Figure 2, narrow enough for `width` columns."""
    side = len(left[1])
    is_wide = width >= 4 * side + 3
    table = Table.grid(padding=(0, 3, 0, 0))
    table.add_row(Text(left[0], "bold"), Text(right[0], "bold"))
    table.add_row(draw_board(left[1], is_wide=is_wide), draw_board(right[1], is_wide=is_wide))
    return Group(Text(title), table)
