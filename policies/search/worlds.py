"""Worlds that may be: the truth of a match, as a seat could think it, many times over."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.state import Rule, State, Tables, make_state
from arena.game.types import Team
from arena.jit import jit


class Worlds(NamedTuple):
    """Some worlds; row i of every array is world i."""

    state: State
    knows: NDArray[np.uint8]
    """Shape (n, 2 teams): whether a team knows where the enemy's flag lies."""
    raided: NDArray[np.int32]
    """Shape (n, 2 teams): the last tick at which a team saw an intruder on its half."""
    role: NDArray[np.int8]
    """Shape (n, units): a `roles.Role`."""
    goal: NDArray[np.int16]
    """Shape (n, units): the cell to which a role leads that has one, or -1."""
    model: NDArray[np.int8]
    """Shape (n, 2 teams): the row of `models.MODELS` by which a team plays."""


def make_worlds(ruleset: Ruleset, n: int, shared: State | None = None) -> Worlds:
    """Return memory for `n` worlds; ground and keys are those of `shared`, if it is given."""
    state = make_state(ruleset, n)
    if shared is not None:
        state = state._replace(ground=shared.ground, key=shared.key)
    n_units = state.cell.shape[1]
    return Worlds(
        state=state,
        knows=np.zeros((n, len(Team)), np.uint8),
        raided=np.zeros((n, len(Team)), np.int32),
        role=np.zeros((n, n_units), np.int8),
        goal=np.full((n, n_units), -1, np.int16),
        model=np.zeros((n, len(Team)), np.int8),
    )


@jit(inline=True)
def as_index(number: int) -> int:
    """Return a number below 65536 in such a way that the compiler knows that it is not negative.

    Every index that may be negative costs a test and a choice, which took a third of a playout.
    """
    return np.int64(np.uint16(number))  # type: ignore[return-value]  # what numba calls an int


@jit(inline=True)
def units_of(team: int, tables: Tables) -> tuple[int, int, int]:
    """Return a team's first unit, the first that flies, and the first after them."""
    blue = as_index(tables.rule[Rule.BLUE_UNITS])
    if team:
        return blue, blue + as_index(tables.rule[Rule.RED_WALKERS]), blue + as_index(tables.rule[Rule.RED_UNITS])
    return 0, as_index(tables.rule[Rule.BLUE_WALKERS]), blue


@jit(inline=True)
def copy_world(one: int, source: Worlds, other: int, target: Worlds) -> None:
    """Make one world like another, ground and keys apart."""
    for unit in range(target.role.shape[1]):
        target.state.cell[other, unit] = source.state.cell[one, unit]
        target.state.alive[other, unit] = source.state.alive[one, unit]
        target.role[other, unit], target.goal[other, unit] = source.role[one, unit], source.goal[one, unit]
    for field in range(target.state.field.shape[1]):
        target.state.field[other, field] = source.state.field[one, field]
    for team in range(2):
        target.knows[other, team], target.raided[other, team] = source.knows[one, team], source.raided[one, team]
        target.model[other, team] = source.model[one, team]
