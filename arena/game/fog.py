"""What each team may see: the union of its living units' discs of sight, and nothing else.

The law of the fog stands in `arena.game.observation`; this is the one place that draws it.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.bits import cover
from arena.game.state import Rule, Shape, State, Tables, Trait
from arena.game.types import Code
from arena.jit import jit

_WORD = np.int64(64)
_EVERYTHING = np.uint64(0xFFFFFFFFFFFFFFFF)


@jit(inline=True)
def see(
    game: int, shape: Shape, state: State, tables: Tables, boards: NDArray[np.int8], visible: NDArray[np.uint64], with_units: bool
) -> None:
    """Write what both teams see of one game.

    Parameters
    ----------
    shape
        A constant, on the path for the default board.
    boards
        int8, shape (2 teams, n, stride). Cells out of sight become -1.
    visible
        uint64, shape (words or more,): scratch memory.
    with_units
        Write the paper's Table 2 board instead of what lies under the units.
    """
    _, blue, _, red, _ = shape
    _cover_board(game, shape, state, tables, boards[0], visible, 0, blue)
    _cover_board(game, shape, state, tables, boards[1], visible, blue, blue + red)
    if with_units:
        for team in range(2):
            board = boards[team]
            _stamp_flyers(game, shape, state, board, 1 - team)
            _stamp_flyers(game, shape, state, board, team)
            _stamp_walkers(game, shape, state, board)


@jit(inline=True)
def _cover_board(
    game: int,
    shape: Shape,
    state: State,
    tables: Tables,
    board: NDArray[np.int8],
    visible: NDArray[np.uint64],
    first: int,
    last: int,
) -> None:
    """Show the cells that units first .. last - 1 see."""
    cells = shape[0] * shape[0]
    n_words = (cells + _WORD - 1) // _WORD
    for word in range(n_words):
        visible[word] = np.uint64(0) if tables.rule[Rule.FOG] else _EVERYTHING
    for unit in range(first, last):
        stand = int(state.cell[game, unit]) if state.alive[game, unit] else cells
        kind = tables.unit[unit, Trait.TYPE]
        for word in range(n_words):
            visible[word] |= tables.disc[kind, stand, word]
    for word in range(n_words):
        cover(board, state.ground, game, word * _WORD, visible[word])


@jit(inline=True)
def _stamp_flyers(game: int, shape: Shape, state: State, board: NDArray[np.int8], team: int) -> None:
    _, blue, blue_walkers, red, red_walkers = shape
    if team == 0:
        _stamp(game, state, board, blue_walkers, blue, np.int8(Code.BLUE_UAV))
    else:
        _stamp(game, state, board, blue + red_walkers, blue + red, np.int8(Code.RED_UAV))


@jit(inline=True)
def _stamp_walkers(game: int, shape: Shape, state: State, board: NDArray[np.int8]) -> None:
    _, blue, blue_walkers, _, red_walkers = shape
    _stamp(game, state, board, 0, blue_walkers, np.int8(Code.BLUE_UGV))
    _stamp(game, state, board, blue, blue + red_walkers, np.int8(Code.RED_UGV))


@jit(inline=True)
def _stamp(game: int, state: State, board: NDArray[np.int8], first: int, last: int, code: np.int8) -> None:
    for unit in range(first, last):
        cell = int(state.cell[game, unit])
        if state.alive[game, unit] and board[game, cell] != Code.HIDDEN:
            board[game, cell] = code


@jit()
def spot(
    state: State,
    tables: Tables,
    team: int,
    ground: NDArray[np.int8],
    cell: NDArray[np.int16],
    flies: NDArray[np.uint8],
    kind: NDArray[np.int8],
) -> None:
    """List the enemy units that stand on cells in sight, by cell, then type.

    Parameters
    ----------
    ground
        int8, shape (n, stride): what `see` wrote for `team`, without units.
    cell, flies, kind
        Shape (n, enemy units); filled with the cells, flags and types, then with -1, 0 and -1.
    """
    blue, red = tables.rule[Rule.BLUE_UNITS], tables.rule[Rule.RED_UNITS]
    first, n_enemies = (blue, red) if team == 0 else (0, blue)
    for game in range(len(ground)):
        found = 0
        for enemy in range(first, first + n_enemies):
            stand = state.cell[game, enemy]
            if not state.alive[game, enemy] or ground[game, stand] == Code.HIDDEN:
                continue
            enemy_type = tables.unit[enemy, Trait.TYPE]
            slot = found
            while slot > 0 and (
                cell[game, slot - 1] > stand or (cell[game, slot - 1] == stand and kind[game, slot - 1] > enemy_type)
            ):
                cell[game, slot], flies[game, slot], kind[game, slot] = (
                    cell[game, slot - 1],
                    flies[game, slot - 1],
                    kind[game, slot - 1],
                )
                slot -= 1
            cell[game, slot], flies[game, slot], kind[game, slot] = stand, tables.unit[enemy, Trait.FLIES], enemy_type
            found += 1
        for slot in range(found, n_enemies):
            cell[game, slot], flies[game, slot], kind[game, slot] = -1, 0, -1
