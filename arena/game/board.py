"""A board as text, and back.

Two layouts are read. In letters, one a cell, blue's half is the left one:

    .  land     #  obstacle     F U A  blue flag, UGV, UAV     f u a  the red ones

In numbers, those of the paper's Table 2 separated by spaces, which is the layout of the game's earlier public version; here every
cell of land says whose it is, and a unit stands on its own team's land.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arena.errors import BoardError
from arena.game.rules import can_enter, column_after, is_on_board, row_after
from arena.game.types import FLAGS, HALVES, UAVS, UGVS, Action, Code, Team

_LETTERS = {
    "#": Code.OBSTACLE,
    "F": Code.BLUE_FLAG,
    "U": Code.BLUE_UGV,
    "A": Code.BLUE_UAV,
    "f": Code.RED_FLAG,
    "u": Code.RED_UGV,
    "a": Code.RED_UAV,
}
_SHOWN = {Code.HIDDEN: "?", Code.BLUE_HALF: ".", Code.RED_HALF: "."} | {code: letter for letter, code in _LETTERS.items()}
Cell = tuple[int, int]
"""(row, column)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Board:
    """A board as it stands before the first tick."""

    ground: NDArray[np.int8]
    """Shape (side, side): halves, flags and obstacles. Read-only."""
    walkers: tuple[tuple[Cell, ...], tuple[Cell, ...]]
    """Where blue's and red's UGVs stand."""
    flyers: tuple[tuple[Cell, ...], tuple[Cell, ...]]

    @property
    def side(self) -> int:
        """Rows, and columns."""
        return len(self.ground)

    def flag(self, team: Team) -> Cell:
        """Return where a team's flag lies."""
        row, column = np.argwhere(self.ground == FLAGS[team])[0]
        return int(row), int(column)


def parse_board(text: str) -> Board:
    """Read a board in either layout; one that cannot be played on is refused with what is wrong, and where."""
    lines = [line.split() if any(c.isdigit() for c in text) else list("".join(line.split())) for line in text.splitlines()]
    lines = [line for line in lines if line]
    side = len(lines)
    for row, line in enumerate(lines):
        if len(line) != side:
            raise BoardError(f"board, row {row + 1}: {len(line)} cells in a board of {side} rows; it must be square")
    if side % 2 or not 4 <= side <= 64:
        raise BoardError(f"board: {side} x {side} cells; the side must be even, from 4 to 64")
    codes = np.array(
        [[_read(cell, row, column, side) for column, cell in enumerate(line)] for row, line in enumerate(lines)], np.int8
    )
    ground = _ground(codes, in_letters=not any(c.isdigit() for c in text))
    board = Board(
        ground=ground,
        walkers=(_find(codes, UGVS[Team.BLUE]), _find(codes, UGVS[Team.RED])),
        flyers=(_find(codes, UAVS[Team.BLUE]), _find(codes, UAVS[Team.RED])),
    )
    _check_flags(board)
    _check_ways(board)
    return board


def format_board(codes: NDArray[np.int8]) -> str:
    """Return a board as text: in letters where blue's half is the left one, else in numbers; a hidden cell is a `?`.

    Parameters
    ----------
    codes
        The paper's Table 2, shape (side, side). `parse_board` reads the text again, unless a cell is hidden or a flag covered.
    """
    half = len(codes) // 2
    in_letters = not (codes[:, :half] == Code.RED_HALF).any() and not (codes[:, half:] == Code.BLUE_HALF).any()
    if in_letters:
        return "\n".join("".join(_SHOWN[Code(code)] for code in row) for row in codes.tolist())
    return "\n".join(" ".join("?" if code == Code.HIDDEN else str(code) for code in row) for row in codes.tolist())


def _read(cell: str, row: int, column: int, side: int) -> int:
    if cell == ".":
        return Code.BLUE_HALF if column < side // 2 else Code.RED_HALF
    if cell in _LETTERS:
        return _LETTERS[cell]
    if cell.isdecimal() and int(cell) <= Code.OBSTACLE:
        return int(cell)
    known = f"the letters . {' '.join(_LETTERS)}, or the numbers 0 to 8"
    raise BoardError(f"board, row {row + 1}, column {column + 1}: {cell!r} is no cell; a board is drawn with {known}")


def _ground(codes: NDArray[np.int8], in_letters: bool) -> NDArray[np.int8]:
    """Return what lies under the units."""
    ground = codes.copy()
    half = len(codes) // 2
    for team in Team:
        units = (codes == UGVS[team]) | (codes == UAVS[team])
        ground[units] = HALVES[team]
        if in_letters:
            left = units[:, :half]
            ground[:, :half][left] = Code.BLUE_HALF
            ground[:, half:][units[:, half:]] = Code.RED_HALF
    ground.flags.writeable = False
    return ground


def _find(codes: NDArray[np.int8], code: Code) -> tuple[Cell, ...]:
    return tuple((int(row), int(column)) for row, column in np.argwhere(codes == code))


def _check_flags(board: Board) -> None:
    for team in Team:
        n_flags = int((board.ground == FLAGS[team]).sum())
        if n_flags != 1:
            raise BoardError(
                f"board: {n_flags or 'no'} {team.name.lower()} flag{'s' if n_flags > 1 else ''}; each team needs one"
            )


def _check_ways(board: Board) -> None:
    for team in Team:
        flag = board.flag(team.other)
        reached = _reach(board.ground, flag)
        for row, column in board.walkers[team]:
            if (row, column) not in reached:
                raise BoardError(
                    f"board: the {team.name.lower()} UGV at row {row + 1}, column {column + 1} has no way to the enemy flag "
                    f"at row {flag[0] + 1}, column {flag[1] + 1}"
                )


def _reach(ground: NDArray[np.int8], start: Cell) -> set[Cell]:
    """Return the cells that are connected to `start` without crossing an obstacle."""
    side = len(ground)
    reached, queue = {start}, deque([start])
    while queue:
        row, column = queue.popleft()
        for action in Action:
            cell = row_after(row, action), column_after(column, action)
            if cell not in reached and is_on_board(*cell, side) and can_enter(ground[cell], 0):
                reached.add(cell)
                queue.append(cell)
    return reached
