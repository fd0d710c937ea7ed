"""The true state as planes in the frame of a team: what the critic sees beyond that team's view, in training only."""

import numpy as np
from numpy.typing import NDArray

from arena.game.engine import BatchedGame
from arena.game.state import State, StateField
from arena.game.types import Code, Team
from arena.jit import jit
from policies.networks.features import ONE, framed
from policies.networks.judges import N_TRUTH_PLANES

_OBSTACLE = int(Code.OBSTACLE)
_ENEMY_UGV, _ENEMY_UAV, _OWN_FLAG, _ENEMY_FLAG, _WALL = range(N_TRUTH_PLANES)


def reveal(games: BatchedGame, team: Team, is_turned: NDArray[np.bool_], planes: NDArray[np.uint8]) -> None:
    """Write the true planes of some rows.

    Parameters
    ----------
    is_turned
        Shape (n,): whether the frame of each row's team is the board's mirror image; the first n rows are written.
    planes
        uint8, shape (n, side, side, N_TRUTH_PLANES): the enemy's units on foot and in the air, both flags, obstacles.
    """
    n_blue = games.n_units[Team.BLUE]
    first, last = (n_blue, n_blue + games.n_units[Team.RED]) if team is Team.BLUE else (0, n_blue)
    flies = np.array([unit.flies for unit in games.ruleset.team(team.other)], np.uint8)
    _reveal(games.state, int(team), first, last, flies, is_turned, planes)


@jit()
def _reveal(
    state: State,
    team: int,
    first: int,
    last: int,
    flies: NDArray[np.uint8],
    is_turned: NDArray[np.bool_],
    planes: NDArray[np.uint8],
) -> None:
    side = planes.shape[1]
    for game in range(len(planes)):
        board = planes[game]
        board[:] = 0
        for cell in range(side * side):
            if state.ground[game, cell] == _OBSTACLE:
                there = framed(cell, side, is_turned[game])
                board[there // side, there % side, _WALL] = ONE
        for plane, flag in ((_OWN_FLAG, StateField.BLUE_FLAG + team), (_ENEMY_FLAG, StateField.RED_FLAG - team)):
            there = framed(int(state.field[game, flag]), side, is_turned[game])
            board[there // side, there % side, plane] = ONE
        for unit in range(first, last):
            if state.alive[game, unit]:
                there = framed(int(state.cell[game, unit]), side, is_turned[game])
                board[there // side, there % side, _ENEMY_UAV if flies[unit - first] else _ENEMY_UGV] += ONE
