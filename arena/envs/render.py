"""A board in the terminal, as letters, or as pixels, for `render`."""

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from arena.display.text import draw_board
from arena.game.types import Code

CELL_PX = 16
_COLOURS = {
    Code.HIDDEN: 0x14171C,
    Code.BLUE_HALF: 0x10243F,
    Code.RED_HALF: 0x3D1A10,
    Code.BLUE_UGV: 0x2F7DE1,
    Code.BLUE_UAV: 0x8FC1FF,
    Code.RED_UGV: 0xFF9D4D,
    Code.RED_UAV: 0xFFD2A8,
    Code.BLUE_FLAG: 0x00E5FF,
    Code.RED_FLAG: 0xFFF04D,
    Code.OBSTACLE: 0x595959,
}
_PALETTE = np.array([[colour >> shift & 0xFF for shift in (16, 8, 0)] for _, colour in sorted(_COLOURS.items())], np.uint8)


def draw_letters(grid: NDArray[np.int8]) -> str:
    """Return a Table 2 board as lines of letters."""
    return draw_board(grid, is_wide=False).plain + "\n"


def show(grid: NDArray[np.int8]) -> None:
    """Print a Table 2 board in the terminal, in colour where there is any."""
    Console().print(draw_board(grid, is_wide=True))


def paint(grid: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Return a Table 2 board as a picture; uint8, shape (side * CELL_PX, side * CELL_PX, 3)."""
    return _PALETTE[grid - int(Code.HIDDEN)].repeat(CELL_PX, axis=0).repeat(CELL_PX, axis=1)
