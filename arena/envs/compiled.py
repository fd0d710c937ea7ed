"""The kernels that write what teams know as the arrays of an environment."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter, column_after, is_home, is_on_board, row_after
from arena.game.types import Action, Code
from arena.jit import compile_for, jit

_STAY, _N_ACTIONS = int(Action.STAY), len(Action)
_HIDDEN = int(Code.HIDDEN)


@jit(keeps_gil=True)
def find_turned(ground: NDArray[np.int8], side: int, team: int, is_turned: NDArray[np.bool_]) -> None:
    """Write in which of n matches a team's own half is the eastern one, as far as most of the cells in its sight tell.

    Parameters
    ----------
    ground
        As `arena.game.observation.Observations` has it.
    is_turned
        Written: bool, shape (n,); false where nothing is in sight.
    """
    half, other = side // 2, 1 - team
    for game in range(len(is_turned)):
        east = 0
        for row in range(side):
            first = row * side
            for column in range(half):  # without a branch, so that it runs in vector registers
                west, code = ground[game, first + column], ground[game, first + half + column]
                east += int(is_home(code, team)) - int(is_home(code, other))
                east -= int(is_home(west, team)) - int(is_home(west, other))
        is_turned[game] = east > 0


@jit(keeps_gil=True)
def write_view(
    is_turned: NDArray[np.bool_],
    codes: NDArray[np.int8],
    actions: NDArray[np.int8],
    stamps: NDArray[np.int8],
    types: NDArray[np.int8],
    flies: NDArray[np.uint8],
    ground: NDArray[np.int8],
    cell: NDArray[np.int16],
    alive: NDArray[np.uint8],
    enemy_cell: NDArray[np.int16],
    enemy_type: NDArray[np.int8],
    grid: NDArray[np.int8],
    units: NDArray[np.int16],
    enemies: NDArray[np.int16],
    legal: NDArray[np.int8],
) -> None:
    """Write what a team knows in each of n matches.

    Parameters
    ----------
    is_turned
        Shape (n,): whether what is east on the board is written as west.
    codes
        What each cell's `Code`, counted from HIDDEN, is written as.
    actions
        Shape (2, actions): what each `Action` is written as; in the second row, where the board is turned.
    stamps
        Shape (2, 2): the codes of an enemy and of an own unit, of walking ones first.
    types, flies
        Shape (own units,): index into `Ruleset.units`; and of each type, shape (types,), whether it flies.
    ground, cell, alive, enemy_cell, enemy_type
        As `arena.game.observation.Observations` has them.
    grid, units, enemies, legal
        Written: shape (n, side, side), (n, own units, 4), (n, enemies, 3), (n, own units, actions).
    """
    side = grid.shape[1]
    n_own, n_enemies = cell.shape[1], enemy_cell.shape[1]
    for game in range(len(grid)):
        turned = is_turned[game]
        written = actions[1 if turned else 0]
        for row in range(side):
            for column in range(side):
                shown = side - 1 - column if turned else column
                grid[game, row, shown] = codes[ground[game, row * side + column] - _HIDDEN]
        for enemy in range(n_enemies):
            for trait in range(3):
                enemies[game, enemy, trait] = -1
        for slot in range(n_enemies):  # by row, then column, then type, as they are shown
            stand, kind = int(enemy_cell[game, slot]), int(enemy_type[game, slot])
            if stand < 0:
                break
            row, column = stand // side, stand % side
            if turned:
                column = side - 1 - column
            place = slot
            while place > 0 and enemies[game, place - 1, 0] == row and enemies[game, place - 1, 1] > column:
                for trait in range(3):
                    enemies[game, place, trait] = enemies[game, place - 1, trait]
                place -= 1
            enemies[game, place, 0], enemies[game, place, 1], enemies[game, place, 2] = row, column, kind
        for unit in range(n_own):
            stand, lives = int(cell[game, unit]), alive[game, unit] != 0
            row, column = stand // side, stand % side
            units[game, unit, 0] = row
            units[game, unit, 1] = side - 1 - column if turned else column
            units[game, unit, 2] = types[unit]
            units[game, unit, 3] = lives
            for action in range(_N_ACTIONS):
                there, across = row_after(row, action), column_after(column, action)
                may = action == _STAY
                if not may and lives and is_on_board(there, across, side):
                    may = can_enter(ground[game, there * side + across], flies[types[unit]])
                legal[game, unit, written[action]] = may
        for walks in range(2):  # the Table 2 board: a UGV hides a UAV, and an own UAV the enemy's
            for enemy in range(n_enemies):
                if enemies[game, enemy, 0] >= 0 and flies[enemies[game, enemy, 2]] != walks:
                    grid[game, enemies[game, enemy, 0], enemies[game, enemy, 1]] = stamps[0, 1 - walks]
            for unit in range(n_own):
                if alive[game, unit] and flies[types[unit]] != walks:
                    grid[game, units[game, unit, 0], units[game, unit, 1]] = stamps[1, 1 - walks]


def compile_writer(*arguments: Any) -> Callable[..., None]:
    """Return `write_view` compiled for arguments of the types of these."""
    return compile_for(write_view, *arguments)


def compile_finder() -> Callable[[NDArray[np.int8], int, int, NDArray[np.bool_]], None]:
    """Return `find_turned`, compiled."""
    return compile_for(find_turned, np.zeros((1, 1), np.int8), 0, 0, np.zeros(1, np.bool_))
