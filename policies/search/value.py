"""What a world is worth that is not played to its end: the share of a win, from what matches came to from there.

The weights are a logistic regression over the states of matches between scripts; `benchmarks.measuring.value_fit` fits them anew.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.state import Rule, StateField, Tables
from arena.jit import jit
from policies.search.ways import NO_WAY, Ways
from policies.search.worlds import Worlds, as_index, units_of

WEIGHTS = np.array([1.27, 1.76, 1.21, 1.06, 0.81])
"""Of each of `write_features`."""
N_FEATURES = len(WEIGHTS)
_IS_SURE = 2
"""By how many steps a unit must be nearer to the flag than every enemy to be taken to get there first."""
_CLOSE = 0.4
"""Within what share of the board a unit is near a flag."""


@jit(inline=True)
def write_features(world: int, me: int, worlds: Worlds, ways: Ways, tables: Tables, out: NDArray[np.float64]) -> None:
    """Write what a value is made of; each changes its sign with the side.

    More units on foot; the same times the square of the share of the match that is over; a unit that is at the flag before any
    enemy, in time; how near to the own flag the nearest guard is; how near to the enemy's flag the nearest unit is.
    """
    state, limit, side = worlds.state, int(tables.rule[Rule.TICK_LIMIT]), float(tables.rule[Rule.SIDE])
    tick = int(state.field[world, StateField.TICK])
    for feature in range(N_FEATURES):
        out[feature] = 0.0
    for team in range(2):
        sign = 1.0 if team == me else -1.0
        first, flyers, _ = units_of(team, tables)
        foe, foes_flyers, _ = units_of(1 - team, tables)
        prize = as_index(state.field[world, StateField.RED_FLAG - team])
        runner, guard = int(NO_WAY), int(NO_WAY)
        for unit in range(first, flyers):
            if state.alive[world, unit]:
                out[0] += sign
                runner = min(runner, int(ways.far[prize, as_index(state.cell[world, unit])]))
        for unit in range(foe, foes_flyers):
            if state.alive[world, unit]:
                guard = min(guard, int(ways.far[prize, as_index(state.cell[world, unit])]))
        if runner + _IS_SURE < guard and runner <= limit - tick:
            out[2] += sign
        out[3] -= sign * max(0.0, 1.0 - guard / side)
        out[4] += sign * max(0.0, 1.0 - runner / (_CLOSE * side))
    out[1] = out[0] * (tick / limit) * (tick / limit)


@jit(inline=True)
def value_of(
    world: int, me: int, worlds: Worlds, ways: Ways, tables: Tables, weights: NDArray[np.float64], scratch: NDArray[np.float64]
) -> float:
    """Return the share of a win that a world is worth to a team."""
    write_features(world, me, worlds, ways, tables, scratch)
    total = 0.0
    for feature in range(N_FEATURES):
        total += weights[feature] * scratch[feature]
    return float(1.0 / (1.0 + np.exp(-total)))
