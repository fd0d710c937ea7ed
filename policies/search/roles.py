"""What units do in playouts: roles without memory, the orders of one team in one world at a time.

A team acts on what it would see: enemies count where one of its own units sees them.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import is_home, squared_distance
from arena.game.state import Rule, StateField, Tables
from arena.jit import jit
from policies.chance import choose, mix
from policies.search.desk import N_SEARCHES, Desk, look, place_units
from policies.search.models import ATTACK, BOUNCE, CHASE, DEFEND, FOLLOW, GO, GUARD, HUNT, PATROL, ROAM, RUSH, WATCH, Column
from policies.search.steps import STAY, aim_at, careful_step, fly_to, may_meet, plain_step, weigh_enemies
from policies.search.ways import NO_WAY, Ways
from policies.search.worlds import Worlds, as_index, units_of

_CHASERS_LIFE, _GUARDS_LIFE, _HUNTERS_LIFE = 5.0, 4.0, 8.0
_WALK_TICKS, _FLY_TICKS = 16, 4
"""For how long a unit looks for a flag in one place."""
_NOBODY, _NEARER, _INTRUDERS, _FROM_ABOVE = range(4)
"""Of `Desk.seeks`: nobody; the nearest, if it is nearer than the target; the intruder nearest to the own flag, or to it;
the nearest by air."""
_NEVER = -1
"""Of `Desk.wanders`, which is else a role."""


@jit(inline=True)
def order_team(
    world: int,
    team: int,
    is_new: bool,
    worlds: Worlds,
    ways: Ways,
    tables: Tables,
    rows: NDArray[np.int64],
    desk: Desk,
    seed: np.uint64,
    orders: NDArray[np.int8],
) -> None:
    """Write the orders of all units of a team, by their roles; `place_units` has been here.

    Parameters
    ----------
    is_new
        Whether this is a world's first tick, or roles have changed since the last.
    rows
        `models.ROWS`, which numba would else compile in as constants.
    orders
        int8, shape (worlds, units).
    """
    state, model = worlds.state, rows[as_index(worlds.model[world, team])]
    first, flyers, last = units_of(team, tables)
    knew = worlds.knows[world, team]
    n_seen = look(world, team, worlds, tables, desk)
    prize, tick = as_index(state.field[world, StateField.RED_FLAG - team]), as_index(state.field[world, StateField.TICK])
    knows = worlds.knows[world, team]
    if is_new or knows != knew or (not knows and tick % _FLY_TICKS == 0):
        _set_targets(world, team, worlds, tables, model, desk)
    chance, is_weighed, careful = mix(seed ^ np.uint64(tick * 2 + team)), False, prize if knows else -1
    for number in range(first, flyers):
        unit = as_index(number)
        orders[world, unit] = STAY
        if not state.alive[world, unit]:
            continue
        index, word = as_index(unit - first), chance >> np.uint64(2 * (unit - first))
        cell, target, wanders, seeks = (
            as_index(state.cell[world, unit]),
            as_index(desk.target[unit]),
            desk.wanders[unit],
            desk.seeks[unit],
        )
        if wanders == ROAM:
            orders[world, unit] = choose(mix(chance + np.uint64(index)), 5)
            continue
        if wanders == PATROL:
            target = _patrol(world, unit, team, cell, worlds, ways, tables, desk)
        elif wanders == BOUNCE:
            target = _bounce(world, unit, team, cell, mix(chance + np.uint64(index)), worlds, ways, tables, desk)
        meets = False
        if n_seen:
            enemy = -1
            if seeks == _NEARER:
                enemy = _nearest(world, cell, int(ways.far[target, cell]) - 1, n_seen, worlds, ways, desk)
            elif seeks == _INTRUDERS:
                enemy = _nearest_intruder(world, team, cell, n_seen, worlds, ways, desk)
            target = as_index(enemy if enemy >= 0 else target)
            meets = desk.life[unit] > 0.0 and may_meet(unit, n_seen, desk)
        target = as_index(ways.open[target])
        if meets:
            if not is_weighed:
                weigh_enemies(world, team, first, flyers, n_seen, worlds, tables, desk)
                is_weighed = True
            orders[world, unit] = careful_step(
                world, team, first, flyers, unit, target, careful, desk.life[unit], n_seen, word, worlds, ways, tables, desk
            )
        else:
            action = plain_step(cell, target, word, ways, tables, desk)
            to = as_index(tables.neighbour[action, cell])
            if model[Column.STAYS] and not is_home(state.ground[world, to], team):
                action, to = STAY, cell
            orders[world, unit] = action
            aim_at(unit, to, desk)
    for unit in range(first, flyers):
        desk.taken[as_index(desk.aim[as_index(unit)])] = 0
    for number in range(flyers, last):
        unit = as_index(number)
        cell, target = as_index(state.cell[world, unit]), as_index(desk.target[unit])
        if not state.alive[world, unit]:
            orders[world, unit] = STAY
        elif desk.wanders[unit] == ROAM:
            orders[world, unit] = choose(mix(chance + np.uint64(unit - first)), 5)
        else:
            if n_seen and desk.seeks[unit] == _FROM_ABOVE:
                target = _nearest_to_flyer(world, cell, n_seen, worlds, tables, desk)
            orders[world, unit] = fly_to(unit, cell, target, tables)


@jit()
def order_team_anew(
    world: int,
    team: int,
    worlds: Worlds,
    ways: Ways,
    tables: Tables,
    rows: NDArray[np.int64],
    desk: Desk,
    seed: np.uint64,
    orders: NDArray[np.int8],
) -> None:
    """`place_units` and `order_team`, compiled once for all who need no more than one tick."""
    place_units(world, worlds, tables, desk)
    order_team(world, team, True, worlds, ways, tables, rows, desk, seed, orders)


@jit(inline=True)
def _set_targets(world: int, team: int, worlds: Worlds, tables: Tables, model: NDArray[np.int64], desk: Desk) -> None:
    """Note what roles come to until they change, or the flag is found, or a flyer's search goes on."""
    field = worlds.state.field
    first, flyers, last = units_of(team, tables)
    home, prize = as_index(field[world, StateField.BLUE_FLAG + team]), as_index(field[world, StateField.RED_FLAG - team])
    knows, tick = worlds.knows[world, team], as_index(field[world, StateField.TICK])
    for number in range(first, last):
        unit = as_index(number)
        index, role = as_index(unit - first), int(worlds.role[world, unit])
        target, life, seeks, wanders = int(desk.lane[team, index]), float(model[Column.LIFE]), _NOBODY, _NEVER
        if unit >= flyers:
            target = prize if knows else int(desk.search[team, 1 + last - unit, tick // _FLY_TICKS % N_SEARCHES])
            if role == GO:
                target = int(worlds.goal[world, unit])
            elif role == WATCH:
                target = home
            elif role == FOLLOW:
                seeks = _FROM_ABOVE
        elif role in (ATTACK, RUSH, CHASE, BOUNCE):
            target = prize if knows else int(desk.search[team, index, tick // _WALK_TICKS % N_SEARCHES])
            if role == BOUNCE and not knows:
                wanders = BOUNCE
            if role == CHASE or model[Column.CHASES]:
                life, seeks = _CHASERS_LIFE if role == CHASE else 0.0, _NEARER
            elif role == RUSH:
                life = 0.0
        elif role == GUARD:
            life, target = _GUARDS_LIFE, home
        elif role == HUNT:
            life, target, seeks = _HUNTERS_LIFE, home, _INTRUDERS
        elif role == DEFEND:
            life, target, seeks = 0.0, _post(index, home, tables), _INTRUDERS
        elif role == GO:
            target = int(worlds.goal[world, unit])
        elif role == PATROL:
            wanders = PATROL
        if role == ROAM:
            wanders = ROAM
        desk.target[unit], desk.life[unit], desk.seeks[unit], desk.wanders[unit] = target, life, seeks, wanders


@jit(inline=True)
def _post(index: int, home: int, tables: Tables) -> int:
    """Return a cell beside a flag; each of eight units has its own."""
    side, place = int(tables.rule[Rule.SIDE]), index % 8 + (index % 8 > 3)  # the ninth, the middle, is the flag itself
    row, column = int(tables.place[home, 0]) + place // 3 - 1, int(tables.place[home, 1]) + place % 3 - 1
    return min(max(row, 0), side - 1) * side + min(max(column, 0), side - 1)


@jit(inline=True)
def _nearest(world: int, cell: int, within: int, n_seen: int, worlds: Worlds, ways: Ways, desk: Desk) -> int:
    """Return the cell of the enemy in sight that is fewest steps away, or -1."""
    nearest, least = -1, within + 1
    for k in range(n_seen):
        at = as_index(worlds.state.cell[world, as_index(desk.seen[k])])
        far = int(ways.far[at, cell])
        if far < least:
            nearest, least = at, far
    return nearest


@jit(inline=True)
def _nearest_intruder(world: int, team: int, cell: int, n_seen: int, worlds: Worlds, ways: Ways, desk: Desk) -> int:
    """Return the cell of the enemy in sight on the own half that is fewest steps from a cell, or -1."""
    nearest, least = -1, NO_WAY
    for k in range(n_seen):
        at = as_index(worlds.state.cell[world, as_index(desk.seen[k])])
        far = int(ways.far[at, cell])
        if far < least and is_home(worlds.state.ground[world, at], team):
            nearest, least = at, far
    return nearest


@jit(inline=True)
def _nearest_to_flyer(world: int, cell: int, n_seen: int, worlds: Worlds, tables: Tables, desk: Desk) -> int:
    """Return the cell of the enemy in sight that is nearest by air; there is one."""
    nearest, least = cell, 1 << 30
    for k in range(n_seen):
        at = as_index(worlds.state.cell[world, as_index(desk.seen[k])])
        down, right = tables.place[at, 0] - tables.place[cell, 0], tables.place[at, 1] - tables.place[cell, 1]
        far = int(squared_distance(down, right))
        if far < least:
            nearest, least = at, far
    return nearest


@jit(inline=True)
def _bounce(
    world: int, unit: int, team: int, cell: int, word: np.uint64, worlds: Worlds, ways: Ways, tables: Tables, desk: Desk
) -> int:
    """Return where a unit is going on the enemy's half: a new cell where it has come to one, or once in sixteen ticks."""
    goal = int(worlds.goal[world, unit])
    if goal < 0 or cell == goal or word & np.uint64(15) == np.uint64(0):
        side = int(tables.rule[Rule.SIDE])
        column = choose(mix(word), side // 2) + (side // 2 if desk.ahead[team] > 0 else 0)
        goal = int(ways.open[choose(word, side) * side + column])
        worlds.goal[world, unit] = goal
    return goal


@jit(inline=True)
def _patrol(world: int, unit: int, team: int, cell: int, worlds: Worlds, ways: Ways, tables: Tables, desk: Desk) -> int:
    """Return the end of the border to which a unit is going; those of even number begin northwards."""
    side = int(tables.rule[Rule.SIDE])
    border = side // 2 - (1 if desk.ahead[team] > 0 else 0)
    north, south = int(ways.open[border]), int(ways.open[(side - 1) * side + border])
    goal = int(worlds.goal[world, unit])
    if goal < 0:
        goal = south if unit % 2 else north
    elif cell == goal:
        goal = south if goal == north else north
    worlds.goal[world, unit] = goal
    return goal
