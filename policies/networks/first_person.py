"""What the `paper` network sees: the board as one unit has it around itself, in raw codes.

The team's fogged Table 2 board is recoded, so that blue's codes mean own and red's mean enemy; turned, so that the enemy's half
is the eastern one; shifted, so that the unit stands at the centre of a window; and what lies off the board is hidden,
unless it is told to show as obstacles. Source: paper, section 3 and Figure 3.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.types import FLAGS, HALVES, UAVS, UGVS, Code, Team
from arena.jit import jit
from policies.belief.memory import Sight, sight_of
from policies.networks.features import mirror

WINDOW = 20
"""Side of the window, in cells; the unit stands at (10, 10)."""
_HIDDEN = int(Code.HIDDEN)
_OWN_UGV, _OWN_UAV, _ENEMY_UGV, _ENEMY_UAV = int(Code.BLUE_UGV), int(Code.BLUE_UAV), int(Code.RED_UGV), int(Code.RED_UAV)


def _recoding(team: Team) -> NDArray[np.int8]:
    """Return what each code, one added, becomes for a team."""
    codes = np.arange(-1, len(Code) - 1, dtype=np.int8)
    if team is Team.RED:
        for blue, red in (HALVES, FLAGS, UGVS, UAVS):
            codes[blue + 1], codes[red + 1] = red, blue
    return codes


def turn_upside_down(observations: Observations) -> Observations:
    """Return what a team would see on the board's north-south mirror image."""
    side, n = observations.side, len(observations)

    def cells(cell: NDArray[np.int16]) -> NDArray[np.int16]:
        return np.where(cell < 0, cell, (side - 1 - cell // side) * side + cell % side).astype(np.int16)

    ground = observations.ground.copy()
    ground[:, : side * side] = ground[:, : side * side].reshape(n, side, side)[:, ::-1].reshape(n, -1)
    return replace(observations, ground=ground, cell=cells(observations.cell), enemy_cell=cells(observations.enemy_cell))


class FirstPerson:
    """Cuts the views of all units of a batch of seats of one team.

    Parameters
    ----------
    edge
        The code that cells off the board show.
    """

    def __init__(
        self, team: Team, side: int, flies: NDArray[np.uint8], n_seats: int, window: int = WINDOW, edge: int = Code.HIDDEN
    ) -> None:
        self._edge = int(edge)
        self._flies = flies
        self._recoded = _recoding(team)
        self._board = np.zeros((side, side), np.int8)
        self._views = np.zeros((n_seats, len(flies), window, window), np.int8)
        self.is_turned = np.zeros(n_seats, np.uint8)
        """Shape (n_seats,): whether east and west are exchanged."""

    def cut(self, observations: Observations) -> NDArray[np.int8]:
        """Return the views, in memory that the next call overwrites.

        Returns
        -------
        ndarray
            int8, shape (n, units, window, window): codes of Table 2, blue's for own, red's for
            enemy. A fallen unit's view is hidden.
        """
        _cut(sight_of(observations), self._flies, self._recoded, self._board, self._edge, self.is_turned, self._views)
        return self._views

    def to_board(self, actions: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return actions of the units' frame, shape (n_seats, units), as orders on the board, as of the last `cut`."""
        return np.where(self.is_turned[:, None].astype(np.bool_), mirror(actions), actions)


@jit(inline=True)
def _draw(seat: int, sight: Sight, flies: NDArray[np.uint8], recoded: NDArray[np.int8], board: NDArray[np.int8]) -> bool:
    """Write the team's Table 2 board, recoded; return whether the own half is the eastern one."""
    side, east = len(board), 0
    for cell in range(side * side):
        code = recoded[sight.ground[seat, cell] + 1]
        board[cell // side, cell % side] = code
        if code in (0, 1):
            east += 1 if (code == 0) == (2 * (cell % side) >= side) else -1
    for is_walking in range(2):  # what flies first: what walks covers it
        for enemy in range(sight.enemy_cell.shape[1]):
            cell = sight.enemy_cell[seat, enemy]
            if cell >= 0 and sight.enemy_flies[seat, enemy] != is_walking:
                board[cell // side, cell % side] = _ENEMY_UGV if is_walking else _ENEMY_UAV
        for unit in range(len(flies)):
            if sight.alive[seat, unit] and flies[unit] != is_walking:
                cell = sight.cell[seat, unit]
                board[cell // side, cell % side] = _OWN_UGV if is_walking else _OWN_UAV
    return east > 0


@jit()
def _cut(
    sight: Sight,
    flies: NDArray[np.uint8],
    recoded: NDArray[np.int8],
    board: NDArray[np.int8],
    edge: int,
    is_turned: NDArray[np.uint8],
    views: NDArray[np.int8],
) -> None:
    side, window = len(board), views.shape[2]
    for seat in range(len(views)):
        turned = _draw(seat, sight, flies, recoded, board)
        is_turned[seat] = turned
        for unit in range(len(flies)):
            view = views[seat, unit]
            view[:] = edge if sight.alive[seat, unit] else _HIDDEN
            if not sight.alive[seat, unit]:
                continue
            cell = int(sight.cell[seat, unit])
            first_row, column = cell // side - window // 2, cell % side
            first_column = (side - 1 - column if turned else column) - window // 2
            for row in range(max(-first_row, 0), min(side - first_row, window)):
                for beside in range(max(-first_column, 0), min(side - first_column, window)):
                    there = first_column + beside
                    view[row, beside] = board[first_row + row, side - 1 - there if turned else there]
