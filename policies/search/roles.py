"""What units do in playouts: roles without memory, the orders of one team in one world at a time.

A team acts on what it would see: enemies count where one of its own units sees them.
"""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import is_home, squared_distance
from arena.game.state import Rule, StateField, Tables
from arena.jit import jit
from policies.chance import choose, mix
from policies.search.desk import CELL, COLUMN, N_SEARCHES, ROW, Desk, look, place_units
from policies.search.models import ATTACK, BOUNCE, CHASE, DEFEND, FOLLOW, GO, GUARD, HUNT, PATROL, ROAM, RUSH, WATCH, Column
from policies.search.steps import STAY, aim_at, careful_step, fly_to, may_meet, plain_step, weigh_enemies
from policies.search.ways import NO_WAY, Ways
from policies.search.worlds import Worlds, units_of

_CHASERS_LIFE, _GUARDS_LIFE, _HUNTERS_LIFE = 5.0, 4.0, 8.0
_WALK_TICKS, _FLY_TICKS = 16, 4
"""For how long a unit looks for a flag in one place."""


@jit(inline=True)
def order_team(
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
    """Write the orders of all units of a team, by their roles; `place_units` has been here.

    Parameters
    ----------
    rows
        `models.ROWS`, which numba would else compile in as constants.
    orders
        int8, shape (worlds, units).
    """
    state, model = worlds.state, rows[worlds.model[world, team]]
    first, flyers, last = units_of(team, tables)
    n_seen = look(world, team, worlds, tables, desk)
    home, prize = int(state.field[world, StateField.BLUE_FLAG + team]), int(state.field[world, StateField.RED_FLAG - team])
    knows, tick = worlds.knows[world, team], int(state.field[world, StateField.TICK])
    chance = mix(seed ^ np.uint64(tick * 2 + team))
    for unit in range(first, flyers):
        desk.aim[unit, CELL] = -1
    is_weighed = False
    for unit in range(first, last):
        orders[world, unit] = STAY
        if not state.alive[world, unit]:
            continue
        index, role, word = unit - first, int(worlds.role[world, unit]), chance >> np.uint64(2 * (unit - first))
        if role == ROAM:
            orders[world, unit] = choose(mix(chance + np.uint64(index)), 5)
            continue
        if unit >= flyers:
            goal = home
            if role == GO:
                goal = int(worlds.goal[world, unit])
            elif role == FOLLOW and n_seen:
                goal = _nearest_to_flyer(unit, n_seen, desk)
            elif role != WATCH:
                goal = prize if knows else int(desk.search[team, 1 + last - unit, tick // _FLY_TICKS % N_SEARCHES])
            orders[world, unit] = fly_to(unit, goal, tables, desk)
            continue
        cell, life = int(state.cell[world, unit]), float(model[Column.LIFE])
        target, enemy = int(desk.lane[team, index]), -1
        if role in (ATTACK, RUSH, CHASE, BOUNCE):
            if knows:
                target = prize
            elif role == BOUNCE:
                target = _bounce(world, unit, team, cell, mix(chance + np.uint64(index)), worlds, ways, tables, desk)
            else:
                target = int(desk.search[team, index, tick // _WALK_TICKS % N_SEARCHES])
            if role == CHASE or model[Column.CHASES]:
                enemy = _nearest(cell, int(ways.far[target, cell]) - 1, n_seen, ways, desk)
                life = _CHASERS_LIFE if role == CHASE else 0.0
            elif role == RUSH:
                life = 0.0
        elif role == GUARD:
            life, target = _GUARDS_LIFE, home
        elif role == HUNT:
            life, target = _HUNTERS_LIFE, home
            enemy = _nearest_intruder(world, team, cell, n_seen, worlds, ways, desk)
        elif role == DEFEND:
            life, target = 0.0, _post(index, home, tables)
            enemy = _nearest_intruder(world, team, cell, n_seen, worlds, ways, desk)
        elif role == GO:
            target = int(worlds.goal[world, unit])
        elif role == PATROL:
            target = _patrol(world, unit, team, cell, worlds, ways, tables, desk)
        target = int(ways.open[enemy if enemy >= 0 else target])
        if life > 0.0 and may_meet(unit, n_seen, desk):
            if not is_weighed:
                weigh_enemies(world, team, first, flyers, n_seen, worlds, tables, desk)
                is_weighed = True
            orders[world, unit] = careful_step(
                world, team, first, flyers, unit, target, prize if knows else -1, life, n_seen, word, worlds, ways, tables, desk
            )
        else:
            action = plain_step(first, unit, cell, target, word, ways, tables, desk)
            to = int(tables.neighbour[action, cell])
            if model[Column.STAYS] and not is_home(state.ground[world, to], team):
                action, to = STAY, cell
            orders[world, unit] = action
            aim_at(unit, to, tables, desk)


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
    order_team(world, team, worlds, ways, tables, rows, desk, seed, orders)


@jit(inline=True)
def _post(index: int, home: int, tables: Tables) -> int:
    """Return a cell beside a flag; each of eight units has its own."""
    side, place = int(tables.rule[Rule.SIDE]), index % 8 + (index % 8 > 3)  # the ninth, the middle, is the flag itself
    row, column = int(tables.place[home, 0]) + place // 3 - 1, int(tables.place[home, 1]) + place % 3 - 1
    return min(max(row, 0), side - 1) * side + min(max(column, 0), side - 1)


@jit(inline=True)
def _nearest(cell: int, within: int, n_seen: int, ways: Ways, desk: Desk) -> int:
    """Return the cell of the enemy in sight that is fewest steps away, or -1."""
    nearest, least = -1, within + 1
    for enemy in range(n_seen):
        far = int(ways.far[desk.seen[enemy, CELL], cell])
        if far < least:
            nearest, least = int(desk.seen[enemy, CELL]), far
    return nearest


@jit(inline=True)
def _nearest_intruder(world: int, team: int, cell: int, n_seen: int, worlds: Worlds, ways: Ways, desk: Desk) -> int:
    """Return the cell of the enemy in sight on the own half that is fewest steps from a cell, or -1."""
    nearest, least = -1, NO_WAY
    for enemy in range(n_seen):
        at = int(desk.seen[enemy, CELL])
        far = int(ways.far[at, cell])
        if far < least and is_home(worlds.state.ground[world, at], team):
            nearest, least = at, far
    return nearest


@jit(inline=True)
def _nearest_to_flyer(unit: int, n_seen: int, desk: Desk) -> int:
    """Return the cell of the enemy in sight that is nearest by air; there is one."""
    nearest, least = int(desk.seen[0, CELL]), 1 << 30
    for enemy in range(n_seen):
        far = int(squared_distance(desk.seen[enemy, ROW] - desk.row[unit], desk.seen[enemy, COLUMN] - desk.column[unit]))
        if far < least:
            nearest, least = int(desk.seen[enemy, CELL]), far
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
