"""The kernels that play a batch of games: step, observe, draw. The caller brings the memory; nothing allocates or raises.

On the default board the sizes are constants, so that the compiler unrolls what it can; any other board takes the same lines
with the sizes read from the tables.
"""

from typing import Any

import numpy as np

from arena.game.draw import draw
from arena.game.fight import fight, judge
from arena.game.fog import see, spot
from arena.game.move import move
from arena.game.philox import Purpose, philox
from arena.game.state import Rule, StateField
from arena.game.types import Termination
from arena.jit import jit

DEFAULT_SHAPE = (20, 6, 4, 6, 4)
"""Side, blue units, blue walkers, red units, red walkers."""


@jit(inline=True)
def _shape(tables: Any) -> Any:
    rule = tables.rule
    return (
        rule[Rule.SIDE], rule[Rule.BLUE_UNITS], rule[Rule.BLUE_WALKERS], rule[Rule.RED_UNITS], rule[Rule.RED_WALKERS],
    )  # fmt: skip


@jit(inline=True)
def _step_one(game: Any, shape: Any, state: Any, orders: Any, tables: Any, work: Any) -> None:
    if state.field[game, StateField.ENDING] == Termination.RUNNING:
        move(game, shape, state, orders, tables, work)
        fight(game, shape, state, tables, work)
        judge(game, shape, state, tables)


@jit()
def step(state: Any, orders: Any, tables: Any, work: Any, special: bool) -> None:
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
    shape = _shape(tables)
    if special and shape == DEFAULT_SHAPE:
        for game in range(len(state.cell)):
            _step_one(game, DEFAULT_SHAPE, state, orders, tables, work)
    else:
        for game in range(len(state.cell)):
            _step_one(game, shape, state, orders, tables, work)


@jit()
def observe(state: Any, tables: Any, boards: Any, rows: Any, with_units: bool, special: bool) -> None:
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
    shape = _shape(tables)
    if special and shape == DEFAULT_SHAPE:
        for game in range(len(state.cell)):
            see(game, DEFAULT_SHAPE, state, tables, boards, rows[0], with_units)
    else:
        for game in range(len(state.cell)):
            see(game, shape, state, tables, boards, rows[0], with_units)


@jit()
def draw_boards(state: Any, tables: Any, games: Any, map_keys: Any, rows: Any) -> int:
    """Lay out `games`, the i-th of them from `map_keys[i]`; return the first that no attempt could lay out, or -1."""
    for i in range(len(games)):
        map_key = (np.uint64(map_keys[i, 0]), np.uint64(map_keys[i, 1]))
        if draw(games[i], state, tables, map_key, rows) < 0:
            return int(games[i])
    return -1


@jit()
def draw_seeds(keys: Any, ticks: Any, seeds: Any) -> None:
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
def sense(state: Any, tables: Any, seat_keys: Any, boards: Any, rows: Any, blue: Any, red: Any) -> None:
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
def play(state: Any, orders: Any, tables: Any, work: Any, seat_keys: Any, boards: Any, rows: Any, blue: Any, red: Any) -> None:
    """Step and sense, in one call: a tick of the referee."""
    step(state, orders, tables, work, True)
    sense(state, tables, seat_keys, boards, rows, blue, red)


@jit(inline=True)
def _tell(state: Any, tables: Any, seat_keys: Any, boards: Any, team: Any, seen: Any) -> None:
    for game in range(len(state.cell)):
        seen.tick[game] = state.field[game, StateField.TICK]
        seen.living[game, 0] = state.field[game, StateField.BLUE_LIVING + team]
        seen.living[game, 1] = state.field[game, StateField.RED_LIVING - team]
        score = state.field[game, StateField.SCORE]
        seen.score[game] = -score if team else score
    spot(state, tables, team, boards[team], seen.enemy_cell, seen.enemy_flies, seen.enemy_type)
    draw_seeds(seat_keys[team], seen.tick, seen.seed)
