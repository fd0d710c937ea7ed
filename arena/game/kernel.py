"""The kernels that play a batch of games: step, observe, draw. The caller brings the memory; nothing allocates or raises.

On the default board the sizes are constants, so that the compiler unrolls what it can; any other board takes the same lines
with the sizes read from the tables.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.draw import draw
from arena.game.fight import fight, judge
from arena.game.fog import see, spot
from arena.game.move import move
from arena.game.observation import Seen
from arena.game.philox import Purpose, philox
from arena.game.state import Rule, Shape, State, StateField, Tables
from arena.game.types import Termination
from arena.jit import jit

DEFAULT_SHAPE = (20, 6, 4, 6, 4)
"""Side, blue units, blue walkers, red units, red walkers."""


@jit(inline=True)
def shape_of(tables: Tables) -> Shape:
    """Return the sizes of a ruleset's boards and teams."""
    rule = tables.rule
    return (
        rule[Rule.SIDE], rule[Rule.BLUE_UNITS], rule[Rule.BLUE_WALKERS], rule[Rule.RED_UNITS], rule[Rule.RED_WALKERS],
    )  # fmt: skip


@jit(inline=True)
def step_one(game: int, shape: Shape, state: State, orders: NDArray[np.int8], tables: Tables, work: NDArray[np.int64]) -> None:
    """Play one tick of a game, unless it is over."""
    if state.field[game, StateField.ENDING] == Termination.RUNNING:
        move(game, shape, state, orders, tables, work)
        fight(game, shape, state, tables, work)
        judge(game, shape, state, tables)


@jit()
def step(state: State, orders: NDArray[np.int8], tables: Tables, work: NDArray[np.int64], special: bool) -> None:
    """Play one tick of every game that is not over.

    Parameters
    ----------
    orders
        int8, shape (n, units): blue's units first; any number that is no `Action` means to stay.
    work
        int64, shape (4, 32): scratch memory, one per thread.
    special
        Take the path for the default board where it fits. The result is the same.
    """
    shape = shape_of(tables)
    if special and shape == DEFAULT_SHAPE:
        for game in range(len(state.cell)):
            step_one(game, DEFAULT_SHAPE, state, orders, tables, work)
    else:
        for game in range(len(state.cell)):
            step_one(game, shape, state, orders, tables, work)


@jit()
def observe(
    state: State, tables: Tables, boards: NDArray[np.int8], rows: NDArray[np.uint64], with_units: bool, special: bool
) -> None:
    """Write what both teams see of every game.

    Parameters
    ----------
    boards
        int8, shape (2 teams, n, stride).
    rows
        uint64, shape (2, side + 2): scratch memory, one per thread.
    with_units
        Write the paper's Table 2 boards instead of what lies under the units.
    """
    shape = shape_of(tables)
    if special and shape == DEFAULT_SHAPE:
        for game in range(len(state.cell)):
            see(game, DEFAULT_SHAPE, state, tables, boards, rows[0], with_units)
    else:
        for game in range(len(state.cell)):
            see(game, shape, state, tables, boards, rows[0], with_units)


@jit()
def draw_boards(
    state: State, tables: Tables, games: NDArray[np.int64], map_keys: NDArray[np.uint32], rows: NDArray[np.uint64]
) -> int:
    """Lay out `games`, the i-th of them from `map_keys[i]`; return the first that no attempt could lay out, or -1."""
    for i in range(len(games)):
        map_key = (np.uint64(map_keys[i, 0]), np.uint64(map_keys[i, 1]))
        if draw(games[i], state, tables, map_key, rows) < 0:
            return int(games[i])
    return -1


@jit()
def draw_seeds(keys: NDArray[np.uint32], ticks: NDArray[np.int32], seeds: NDArray[np.uint64]) -> None:
    """Write each seat's seed of its tick.

    Parameters
    ----------
    keys
        uint32, shape (n, 2).
    ticks
        int32, shape (n,).
    seeds
        uint64, shape (n,).
    """
    for seat in range(len(ticks)):
        words = philox(keys[seat], ticks[seat], 0, Purpose.SEED, 0)
        seeds[seat] = words[0] << np.uint64(32) | words[1]


@jit()
def sense(
    state: State,
    tables: Tables,
    seat_keys: NDArray[np.uint32],
    boards: NDArray[np.int8],
    rows: NDArray[np.uint64],
    blue: Seen,
    red: Seen,
) -> None:
    """Write all that both teams are told of every game, in one call.

    Parameters
    ----------
    seat_keys
        uint32, shape (2 teams, n, 2).
    boards, rows
        As `observe`.
    blue, red
        `Seen` of each team.
    """
    observe(state, tables, boards, rows, False, True)
    _tell(state, tables, seat_keys, boards, 0, blue)
    _tell(state, tables, seat_keys, boards, 1, red)


@jit(keeps_gil=True)
def play(
    state: State,
    orders: NDArray[np.int8],
    tables: Tables,
    work: NDArray[np.int64],
    seat_keys: NDArray[np.uint32],
    boards: NDArray[np.int8],
    rows: NDArray[np.uint64],
    blue: Seen,
    red: Seen,
) -> None:
    """Step and sense, in one call: a tick of the referee."""
    step(state, orders, tables, work, True)
    sense(state, tables, seat_keys, boards, rows, blue, red)


@jit(inline=True)
def _tell(state: State, tables: Tables, seat_keys: NDArray[np.uint32], boards: NDArray[np.int8], team: int, seen: Seen) -> None:
    for game in range(len(state.cell)):
        seen.tick[game] = state.field[game, StateField.TICK]
        seen.living[game, 0] = state.field[game, StateField.BLUE_LIVING + team]
        seen.living[game, 1] = state.field[game, StateField.RED_LIVING - team]
        score = state.field[game, StateField.SCORE]
        seen.score[game] = -score if team else score
    spot(state, tables, team, boards[team], seen.enemy_cell, seen.enemy_flies, seen.enemy_type)
    draw_seeds(seat_keys[team], seen.tick, seen.seed)
