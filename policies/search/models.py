"""Opponents as playouts know them: how many of a team take which role when. Each is a row of numbers; `roles` does the rest.

None is the fighter whose name it has: it is what a few numbers keep of it.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from arena.game.state import Rule, StateField, Tables
from arena.game.types import Team
from arena.jit import jit
from policies.search.ways import Ways
from policies.search.worlds import Worlds, units_of


class Role(IntEnum):
    """What a unit is about."""

    ATTACK = 0
    """To the enemy's flag, round danger."""
    RUSH = 1
    """To the enemy's flag, whatever it costs."""
    GUARD = 2
    """At the own flag."""
    HUNT = 3
    """At the nearest intruder, else as a guard."""
    HOLD = 4
    """In a lane of the own half."""
    GO = 5
    """To its goal, and there it stays."""
    CHASE = 6
    """At the nearest enemy in sight, else to the enemy's flag."""
    ROAM = 7
    """At random."""
    PATROL = 8
    """Up and down the border."""
    BOUNCE = 9
    """From one random cell of the enemy's half to the next, until the flag is known."""
    SCOUT = 10
    """Of units that fly: to the enemy's flag, or where it may lie."""
    WATCH = 11
    """Of units that fly: over the own flag."""
    FOLLOW = 12
    """Of units that fly: over the nearest enemy on foot."""
    DEFEND = 13
    """At the nearest intruder, whatever it costs, else beside the own flag."""


ATTACK, RUSH, GUARD, HUNT, HOLD, GO, CHASE, ROAM, PATROL, BOUNCE, SCOUT, WATCH, FOLLOW, DEFEND = map(int, Role)
"""The same for kernels, which store plain numbers."""


class Column(IntEnum):
    """Columns of `ROWS`."""

    REST = 0
    """The role of all for whom nothing else is said."""
    CALM = 1
    """Ticks without an intruder after which the enemy is taken to stay at home."""
    GUARDS = 2
    """How many guard while somebody raids; as the next."""
    HUNTERS = 3
    CALM_GUARDS = 4
    CALM_HOLDERS = 5
    LATE = 6
    """Percent of the match from which, unless ahead, what follows holds."""
    LATE_GUARDS = 7
    """While somebody raids, and nobody else."""
    AHEAD_GUARDS = 8
    LIFE = 9
    """What an attacker's life is worth, in steps; an enemy's is worth the same to it."""
    CHASES = 10
    """Whether attackers go for enemies that are nearer than the flag."""
    STAYS = 11
    """Whether none ever leaves the own half."""


_NEVER, _ALL = 101, 16
MODELS = {
    #                rest    calm g     h  cg    ch late    lg ag   life chases stays
    "role_team":     (ATTACK, 16, 2,    1, 0,    0, 80,     2, _ALL, 60, 0, 0),
    "turtle":        (ATTACK, 12, 3,    1, 1,    3, 50,     2, _ALL, 60, 0, 0),
    "border_hunter": (ATTACK, 12, 2,    2, 1,    3, 50,     1, 2,    60, 0, 0),
    "squad":         (ATTACK, 12, 2,    2, 0,    0, _NEVER, 0, _ALL, 60, 0, 0),
    "scout_rush":    (ATTACK, 8,  1,    0, 0,    0, _NEVER, 0, 1,    60, 0, 0),
    "rush":          (RUSH,   0,  0,    0, 0,    0, _NEVER, 0, 0,    0,  0, 0),
    "fighter":       (BOUNCE, 0,  0,    0, 0,    0, _NEVER, 0, 0,    0,  1, 0),
    "defend":        (DEFEND, 0,  0,    0, 0,    0, _NEVER, 0, 0,    0,  0, 1),
    "random":        (ROAM,   0,  0,    0, 0,    0, _NEVER, 0, 0,    0,  0, 0),
    "patrol":        (PATROL, 0,  0,    0, 0,    0, _NEVER, 0, 0,    0,  0, 0),
    "roomba":        (BOUNCE, 0,  0,    0, 0,    0, _NEVER, 0, 0,    0,  0, 0),
}  # fmt: skip
"""By the fighters that they are taken from: the columns of `Column`."""
NAMES = tuple(MODELS)
ROWS = np.array(list(MODELS.values()), np.int64)

ASSIGN_EVERY = 4
"""Ticks between two looks at who takes which role, in playouts and in worlds that go on."""
_NEAR_PRIZE = 6
"""How near to the enemy's flag nobody is called home."""


def shares_of_models(worlds: Worlds, team: Team) -> NDArray[np.float64]:
    """Return in which share of some worlds a team plays by each model, shape (models,)."""
    return np.bincount(worlds.model[:, team], minlength=len(NAMES)) / len(worlds.model)


def role_of_flyer(number: int) -> int:
    """Return the role of a team's first unit that flies, of its second, and so on, where nothing else is said."""
    return WATCH if number % 2 else SCOUT


flyers_role = jit(inline=True)(role_of_flyer)
"""The same for kernels."""


@jit(inline=True)
def assign_roles(world: int, team: int, worlds: Worlds, ways: Ways, tables: Tables, rows: NDArray[np.int64]) -> None:
    """Give every unit of a team the role that its model says, those first that are nearest to their flag."""
    state, model = worlds.state, rows[worlds.model[world, team]]
    first, flyers, last = units_of(team, tables)
    for unit in range(flyers, last):
        worlds.role[world, unit] = ROAM if model[Column.REST] == ROAM else flyers_role(unit - flyers)
    n_living = 0
    for unit in range(first, flyers):
        worlds.role[world, unit] = -1
        n_living += state.alive[world, unit]
    tick, score = int(state.field[world, StateField.TICK]), int(state.field[world, StateField.SCORE])
    is_ahead = score < 0 if team else score > 0
    is_calm = tick - worlds.raided[world, team] >= model[Column.CALM]
    guards, hunters, holders = model[Column.GUARDS], model[Column.HUNTERS], 0
    if is_ahead:
        guards, hunters = model[Column.AHEAD_GUARDS], 0 if is_calm else hunters
    elif 100 * tick >= model[Column.LATE] * tables.rule[Rule.TICK_LIMIT]:
        guards, hunters = 0 if is_calm else model[Column.LATE_GUARDS], 0
    elif is_calm:
        guards, hunters, holders = model[Column.CALM_GUARDS], 0, model[Column.CALM_HOLDERS]
    elif guards < _ALL:
        guards = min(guards, n_living - 1)
    home, prize = int(state.field[world, StateField.BLUE_FLAG + team]), int(state.field[world, StateField.RED_FLAG - team])
    for _ in range(min(guards + hunters + holders, n_living)):
        chosen, least = -1, 1000
        for unit in range(first, flyers):
            cell = state.cell[world, unit]
            stays = is_ahead and worlds.knows[world, team] and ways.far[prize, cell] <= _NEAR_PRIZE
            far = int(ways.far[home, cell])
            if state.alive[world, unit] and worlds.role[world, unit] < 0 and not stays and far < least:
                chosen, least = unit, far
        if chosen < 0:
            break
        if guards > 0:
            guards -= 1
            worlds.role[world, chosen] = GUARD
        elif hunters > 0:
            hunters -= 1
            worlds.role[world, chosen] = HUNT
        else:
            worlds.role[world, chosen] = HOLD
    for unit in range(first, flyers):
        if worlds.role[world, unit] < 0:
            worlds.role[world, unit] = model[Column.REST]
