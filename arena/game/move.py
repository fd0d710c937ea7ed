"""Move at once: every unit names a target, conflicts are settled, nobody goes first.

The short way to see it: if all targets of walking units differ and no two of them would swap, every order succeeds, chains and
rotations included. Only where that fails are conflicts settled one by one.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter, is_move, wins_cell
from arena.game.philox import Purpose, philox
from arena.game.state import Shape, State, StateField, Tables, Trait
from arena.jit import jit

AT, WANT, STAYS, WORD = 0, 1, 2, 3
"""Rows of the scratch memory: one column per walking unit, blue's first."""
_NOWHERE = -1000


@jit(inline=True)
def move(game: int, shape: Shape, state: State, orders: NDArray[np.int8], tables: Tables, work: NDArray[np.int64]) -> None:
    """Move all living units of one game.

    Parameters
    ----------
    orders
        int8, shape (n, units): an `Action` each; any other number means to stay.
    work
        int64, shape (4, 32): scratch memory.
    """
    _, blue, blue_walkers, red, red_walkers = shape
    walkers = blue_walkers + red_walkers
    for walker in range(walkers):
        unit = walker if walker < blue_walkers else blue + walker - blue_walkers
        action = int(orders[game, unit])
        at = int(state.cell[game, unit])
        want = at
        if is_move(action) and tables.unit[unit, Trait.STEP] > 0:
            next_cell = int(tables.neighbour[action, at])
            if can_enter(state.ground[game, next_cell], 0):
                want = next_cell
        if not state.alive[game, unit]:
            at = want = _NOWHERE - walker
        work[AT, walker] = at
        work[WANT, walker] = want
    if _is_contested(work, walkers):
        _settle(game, shape, state, work)
    for walker in range(walkers):
        unit = walker if walker < blue_walkers else blue + walker - blue_walkers
        if state.alive[game, unit]:
            state.cell[game, unit] = work[WANT, walker]
    for unit in range(blue_walkers, blue):
        _fly(game, unit, state, orders, tables)
    for unit in range(blue + red_walkers, blue + red):
        _fly(game, unit, state, orders, tables)


@jit(inline=True)
def _fly(game: int, unit: int, state: State, orders: NDArray[np.int8], tables: Tables) -> None:
    action = int(orders[game, unit])
    if is_move(action) and state.alive[game, unit]:
        cell = int(state.cell[game, unit])
        for _ in range(tables.unit[unit, Trait.STEP]):
            cell = int(tables.neighbour[action, cell])
        state.cell[game, unit] = cell


@jit(inline=True)
def _is_contested(work: NDArray[np.int64], walkers: int) -> bool:
    """Whether two walking units want one cell, or each other's."""
    contested = False
    for one in range(walkers):
        for other in range(one + 1, walkers):
            contested |= work[WANT, one] == work[WANT, other]
            contested |= (work[WANT, one] == work[AT, other]) & (work[WANT, other] == work[AT, one])
    return contested


@jit()
def _settle(game: int, shape: Shape, state: State, work: NDArray[np.int64]) -> None:
    """Make units stay until nothing changes. The result does not depend on the order in which they are looked at."""
    _, _, blue_walkers, _, red_walkers = shape
    walkers = blue_walkers + red_walkers
    tick = state.field[game, StateField.TICK]
    for walker in range(walkers):
        team = 0 if walker < blue_walkers else 1
        index = walker - team * blue_walkers
        work[STAYS, walker] = work[WANT, walker] == work[AT, walker]
        work[WORD, walker] = np.int64(philox(state.key[game, Purpose.MOVE, team], tick, index, Purpose.MOVE, 0)[0])
    changed = True
    while changed:
        changed = False
        for walker in range(walkers):
            if work[STAYS, walker]:
                continue
            for other in range(walkers):
                if other == walker:
                    continue
                held = work[AT, other] == work[WANT, walker]
                is_blocked = held and (work[STAYS, other] or work[WANT, other] == work[AT, walker])
                loses = (
                    not work[STAYS, other]
                    and work[WANT, other] == work[WANT, walker]
                    and wins_cell(work[WORD, other], other, work[WORD, walker], walker)
                )
                if is_blocked or loses:
                    work[STAYS, walker] = 1
                    changed = True
                    break
    for walker in range(walkers):
        if work[STAYS, walker]:
            work[WANT, walker] = work[AT, walker]
