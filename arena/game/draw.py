"""Draw a board: halves, obstacles, flags and units, all from one map key.

Item i of attempt a takes its words from the counter (a, i, BOARD, 0): item 0 says which half is blue's, items 1 to 8 are
the obstacles, item 16 + 32 t is the flag of team t, and the ones after it its units in their order. A row of the board is
a set of columns, one word.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.bits import popcount
from arena.game.compiled import can_enter
from arena.game.philox import Purpose, below, philox
from arena.game.state import Rule, State, StateField, Tables
from arena.game.types import Code
from arena.jit import jit

MAX_ATTEMPTS = 1000
FIRST_OBSTACLE, FIRST_PLACED, PLACED_PER_TEAM = 1, 16, 32
_ONE = np.uint64(1)
MapKey = tuple[np.uint64, np.uint64]
"""Each below 2**32."""


@jit()
def draw(game: int, state: State, tables: Tables, map_key: MapKey, rows: NDArray[np.uint64]) -> int:
    """Lay out one game and set it to tick 0; its fights and moves take their keys from `state.key`.

    Parameters
    ----------
    rows
        uint64, shape (2, side + 2): scratch memory.

    Returns
    -------
    int
        The attempt that gave a board on which every walking unit can reach the enemy flag, or -1 if none of 1,000 did.
    """
    for attempt in range(MAX_ATTEMPTS):
        left = below(philox(map_key, attempt, 0, Purpose.BOARD, 0)[0], 2)
        _draw_ground(game, state, tables, map_key, attempt, left, rows[0])
        if _place(game, state, tables, map_key, attempt, left, rows[0], rows[1]) and is_open(game, state, tables, rows):
            begin(game, state, tables)
            return attempt
    return -1


@jit()
def begin(game: int, state: State, tables: Tables) -> None:
    """Set a laid-out game to tick 0, everybody living."""
    state.alive[game] = 1
    state.event[game] = -1
    field = state.field[game]
    field[StateField.TICK] = field[StateField.ENDING] = field[StateField.SCORE] = 0
    field[StateField.WINNER] = -1
    field[StateField.BLUE_LIVING], field[StateField.RED_LIVING] = tables.rule[Rule.BLUE_UNITS], tables.rule[Rule.RED_UNITS]


@jit(inline=True)
def _draw_ground(
    game: int, state: State, tables: Tables, map_key: MapKey, attempt: int, left: int, free: NDArray[np.uint64]
) -> None:
    """Write halves and obstacles; leave in `free` the columns of each row that hold no obstacle, from row 1 on."""
    side = tables.rule[Rule.SIDE]
    whole = tables.half[0, 0] | tables.half[1, 0]
    free[0] = free[side + 1] = 0
    free[1 : side + 1] = whole
    n_obstacles = np.int64(np.sqrt(side)) if tables.rule[Rule.OBSTACLES] else 0
    longest = max(side // 5, 1)
    for item in range(FIRST_OBSTACLE, FIRST_OBSTACLE + n_obstacles):
        words = philox(map_key, attempt, item, Purpose.BOARD, 0)
        row, column = below(words[0], side), below(words[1], side)
        high, wide = 1 + below(words[2], longest), 1 + below(words[3], longest)
        first, last = max(column - wide, 0), min(column + wide, side)
        block = whole >> np.uint64(side - (last - first)) << np.uint64(first)
        for line in range(max(row - high, 0), min(row + high, side)):
            free[line + 1] &= ~block
    if tables.rule[Rule.MIRROR]:
        _mirror_ground(side, tables.half[left, 0], free)
    for row in range(side):
        for column in range(side):
            code = Code.BLUE_HALF if (column < side // 2) == (left == 0) else Code.RED_HALF
            is_free = free[row + 1] >> np.uint64(column) & _ONE
            state.ground[game, row * side + column] = code if is_free else Code.OBSTACLE


@jit(inline=True)
def _mirror_ground(side: int, blue_half: np.uint64, free: NDArray[np.uint64]) -> None:
    """Put the blue half's obstacles, turned by 180 degrees, on the red half."""
    for row in range(side):
        turned = np.uint64(0)
        source = free[side - row] & blue_half
        for column in range(side):
            turned |= (source >> np.uint64(column) & _ONE) << np.uint64(side - 1 - column)
        free[row + 1] = (free[row + 1] & blue_half) | turned


@jit(inline=True)
def _place(
    game: int,
    state: State,
    tables: Tables,
    map_key: MapKey,
    attempt: int,
    left: int,
    open_: NDArray[np.uint64],
    free: NDArray[np.uint64],
) -> bool:
    """Put flags and units on free cells of their own halves, each on a cell of its own; say whether there was room."""
    side = tables.rule[Rule.SIDE]
    for row in range(side + 2):
        free[row] = open_[row]
    for team in range(2):
        where = left ^ team
        n_units = tables.rule[Rule.RED_UNITS if team else Rule.BLUE_UNITS]
        first_unit = tables.rule[Rule.BLUE_UNITS] * team
        for thing in range(n_units + 1):
            if team == 1 and tables.rule[Rule.MIRROR]:
                if thing == 0:
                    cell = side * side - 1 - int(state.field[game, StateField.BLUE_FLAG])
                else:
                    cell = side * side - 1 - int(state.cell[game, thing - 1])
            else:
                depth = 1 if thing == 0 and tables.rule[Rule.BACK_THIRD] else 0
                word = philox(map_key, attempt, FIRST_PLACED + PLACED_PER_TEAM * team + thing, Purpose.BOARD, 0)[0]
                cell = _pick(side, free, tables.half[where, depth], word)
                if cell < 0:
                    return False
            free[cell // side + 1] &= ~(_ONE << np.uint64(cell % side))
            if thing == 0:
                state.field[game, StateField.BLUE_FLAG + team] = cell
                state.ground[game, cell] = Code.BLUE_FLAG + team
            else:
                state.cell[game, first_unit + thing - 1] = cell
    return True


@jit(inline=True)
def _pick(side: int, free: NDArray[np.uint64], columns: np.uint64, word: np.uint64) -> int:
    """Return a uniform choice, made by `word`, among the free cells in these columns; -1 if there is none."""
    n_free = 0
    for row in range(side):
        n_free += popcount(free[row + 1] & columns)
    if n_free == 0:
        return -1
    rank = below(word, n_free)
    for row in range(side):
        here = free[row + 1] & columns
        n_here = popcount(here)
        if rank < n_here:
            for _ in range(rank):
                here &= here - _ONE
            return int(row * side + popcount((here & (~here + _ONE)) - _ONE))
        rank -= n_here
    return -1


@jit()
def is_open(game: int, state: State, tables: Tables, rows: NDArray[np.uint64]) -> bool:
    """Whether every walking unit can reach the enemy flag, were it alone on the board."""
    side = tables.rule[Rule.SIDE]
    free, reached = rows[0], rows[1]
    free[0] = free[side + 1] = 0
    for row in range(side):
        bits = np.uint64(0)
        for column in range(side):
            bits |= np.uint64(can_enter(state.ground[game, row * side + column], 0)) << np.uint64(column)
        free[row + 1] = bits
    for team in range(2):
        n_walkers = tables.rule[Rule.RED_WALKERS if team else Rule.BLUE_WALKERS]
        if n_walkers == 0:
            continue
        _flood(side, free, reached, int(state.field[game, StateField.RED_FLAG - team]))
        first = tables.rule[Rule.BLUE_UNITS] * team
        for unit in range(first, first + n_walkers):
            cell = int(state.cell[game, unit])
            if not reached[cell // side + 1] >> np.uint64(cell % side) & _ONE:
                return False
    return True


@jit(inline=True)
def _flood(side: int, free: NDArray[np.uint64], reached: NDArray[np.uint64], cell: int) -> None:
    """Fill `reached` with the free cells that are connected to `cell`."""
    reached[: side + 2] = 0
    start = cell // side + 1
    reached[start] = _run_along(free[start], _ONE << np.uint64(cell % side))
    changed = True
    while changed:
        changed = False
        for row in range(1, side + 1):
            changed |= _spread(free, reached, row)
        for row in range(side, 0, -1):
            changed |= _spread(free, reached, row)


@jit(inline=True)
def _spread(free: NDArray[np.uint64], reached: NDArray[np.uint64], row: int) -> bool:
    """Take in what a row's neighbours have reached, and what it leads to; say if anything was new."""
    before = reached[row]
    seeds = (before | reached[row - 1] | reached[row + 1]) & free[row]
    if seeds == before:
        return False
    reached[row] = _run_along(free[row], seeds)
    return True


@jit(inline=True)
def _run_along(free: np.uint64, seeds: np.uint64) -> np.uint64:
    """Return the free columns of one row that are connected to `seeds` within it, doubling the stride."""
    lower = upper = free
    for power in range(6):
        stride = np.uint64(1 << power)
        seeds |= (lower & (seeds << stride)) | (upper & (seeds >> stride))
        lower &= lower << stride
        upper &= upper >> stride
    return seeds
