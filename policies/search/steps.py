"""One step of one unit in a playout: the plain way, the careful one where enemies are near, and over everything."""

import numpy as np

from arena.game.compiled import home_bonus, is_home, is_in_reach, odds, own_strength, squared_distance
from arena.game.state import Rule, Tables, Trait
from arena.game.types import Action
from arena.jit import jit
from policies.search.desk import CELL, COLUMN, ROW, Desk
from policies.search.ways import NO_WAY, Ways
from policies.search.worlds import Worlds

STAY, NORTH, EAST, SOUTH, WEST = (int(action) for action in Action)
_N_ACTIONS = len(Action)
_LOST = 200.0
"""How far a goal is to which no way leads."""
_BLOCKED, _PRIZE = 6.0, 1000.0
"""What it costs to want a friend's cell, and what it is worth to step on the flag, in steps."""
_STEPS_UP = 0.5
"""How likely an enemy that must step up for a fight is taken to do so."""


@jit(inline=True)
def aim_at(unit: int, cell: int, tables: Tables, desk: Desk) -> None:
    """Note where a unit will stand."""
    desk.aim[unit, CELL], desk.aim[unit, ROW], desk.aim[unit, COLUMN] = cell, tables.place[cell, 0], tables.place[cell, 1]


@jit(inline=True)
def plain_step(first: int, unit: int, cell: int, target: int, word: np.uint64, ways: Ways, tables: Tables, desk: Desk) -> int:
    """Return a step that leads nearer on foot and takes no friend's cell, or STAY."""
    best, least, turn = STAY, int(ways.far[target, cell]), int(word & np.uint64(3))
    for k in range(_N_ACTIONS - 1 if least else 0):
        action = 1 + (k + turn) % 4
        to = int(tables.neighbour[action, cell])
        far = int(ways.far[target, to])
        is_free = far < least
        for friend in range(first, unit if is_free else first):
            is_free &= desk.aim[friend, CELL] != to
        if is_free:
            best, least = action, far
    return best


@jit(inline=True)
def may_meet(unit: int, n_seen: int, desk: Desk) -> bool:
    """Whether a unit and an enemy in sight, each after a step, may be in reach of each other."""
    meets = False
    for enemy in range(n_seen):
        down, right = abs(desk.seen[enemy, ROW] - desk.row[unit]), abs(desk.seen[enemy, COLUMN] - desk.column[unit])
        longer, shorter, reach = max(down, right), min(down, right), desk.reach[enemy]
        meets |= is_in_reach(squared_distance(longer - 1, shorter - 1), reach) | (longer <= 1)
        meets |= is_in_reach(squared_distance(longer - 2, shorter), reach)
    return meets


@jit(inline=True)
def weigh_enemies(world: int, team: int, first: int, last: int, n_seen: int, worlds: Worlds, tables: Tables, desk: Desk) -> None:
    """Note what one more unit in reach of each enemy in sight is worth."""
    strength = int(tables.unit[first, Trait.STRENGTH])
    for enemy in range(n_seen):
        row, column = desk.seen[enemy, ROW], desk.seen[enemy, COLUMN]
        ours, theirs = 0, int(own_strength(desk.might[enemy], tables.rule[Rule.SELF_COUNTS]))
        for unit in range(first, last):
            apart = squared_distance(desk.row[unit] - row, desk.column[unit] - column)
            if desk.living[unit] and is_in_reach(apart, tables.unit[unit, Trait.REACH]):
                ours += tables.unit[unit, Trait.STRENGTH]
        for other in range(n_seen):
            apart = squared_distance(desk.seen[other, ROW] - row, desk.seen[other, COLUMN] - column)
            if other != enemy and is_in_reach(apart, desk.reach[other]):
                theirs += desk.might[other]
        at_home = is_home(worlds.state.ground[world, desk.seen[enemy, CELL]], 1 - team)
        bonus, against = float(home_bonus(not at_home)), float(theirs + home_bonus(at_home))
        for is_counted in range(2):
            others = float(max(ours - strength * is_counted, 0))
            without = odds(others + bonus, against) if others > 0.0 else 0.0
            desk.gain[enemy, is_counted] = odds(others + strength + bonus, against) - without


@jit(inline=True)
def careful_step(
    world: int,
    team: int,
    first: int,
    last: int,
    unit: int,
    target: int,
    prize: int,
    life: float,
    n_seen: int,
    word: np.uint64,
    worlds: Worlds,
    ways: Ways,
    tables: Tables,
    desk: Desk,
) -> int:
    """Return the step that costs least: way left, what it risks, and what it wins.

    Parameters
    ----------
    first, last
        The units on foot of the team.
    prize
        The cell of the enemy's flag, or -1.
    life
        What a life is worth, one's own or an enemy's, in steps.
    """
    ground, cell, turn = worlds.state.ground, int(worlds.state.cell[world, unit]), int(word & np.uint64(3))
    strength, reach = tables.unit[unit, Trait.STRENGTH], tables.unit[unit, Trait.REACH]
    best, least, aim = STAY, 1e9, cell
    for k in range(_N_ACTIONS):
        action = STAY if k == 0 else 1 + (k + turn) % 4
        to = int(tables.neighbour[action, cell])
        if action != STAY and (to == cell or ways.far[to, to] != 0):
            continue
        far, row, column = int(ways.far[target, to]), tables.place[to, 0], tables.place[to, 1]
        cost = float(far) if far != NO_WAY else _LOST
        at_home = is_home(ground[world, to], team)
        against, kills = 0.0, 0.0
        for enemy in range(n_seen):
            down, right = abs(desk.seen[enemy, ROW] - row), abs(desk.seen[enemy, COLUMN] - column)
            longer, shorter = max(down, right), min(down, right)
            if is_in_reach(squared_distance(longer - 1, shorter), desk.reach[enemy]):
                likely = 1.0 if is_in_reach(squared_distance(longer, shorter), desk.reach[enemy]) else _STEPS_UP
                apart = squared_distance(desk.seen[enemy, ROW] - desk.row[unit], desk.seen[enemy, COLUMN] - desk.column[unit])
                against += likely * desk.might[enemy]
                kills += likely * (desk.gain[enemy, 1] if is_in_reach(apart, reach) else desk.gain[enemy, 0])
        if against > 0.0:
            force = float(own_strength(strength, tables.rule[Rule.SELF_COUNTS]) + home_bonus(at_home))
            for friend in range(first, last):
                is_decided = desk.aim[friend, CELL] >= 0
                down = (desk.aim[friend, ROW] if is_decided else desk.row[friend]) - row
                right = (desk.aim[friend, COLUMN] if is_decided else desk.column[friend]) - column
                if friend != unit and desk.living[friend] and is_in_reach(squared_distance(down, right), reach):
                    force += tables.unit[friend, Trait.STRENGTH]
            if tables.rule[Rule.RANDOM_COMBAT]:
                against += home_bonus(not at_home)
                cost += life * (odds(against, force) - kills)
            else:
                cost += life * ((0.0 if at_home else 1.0) - kills)
        for friend in range(first, unit):
            cost += _BLOCKED if desk.aim[friend, CELL] == to else 0.0
        if to == prize:
            cost -= _PRIZE
        if cost < least:
            best, least, aim = action, cost, to
    aim_at(unit, aim, tables, desk)
    return best


@jit(inline=True)
def fly_to(unit: int, goal: int, tables: Tables, desk: Desk) -> int:
    """Return the action that takes a unit that flies nearer to a cell, or STAY where none does."""
    down, right = tables.place[goal, 0] - desk.row[unit], tables.place[goal, 1] - desk.column[unit]
    near = tables.unit[unit, Trait.STEP] // 2
    if abs(down) > abs(right):
        return STAY if abs(down) <= near else SOUTH if down > 0 else NORTH
    return STAY if abs(right) <= near else EAST if right > 0 else WEST
