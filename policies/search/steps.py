"""One step of one unit in a playout: the plain way, the careful one where enemies are near, and over everything."""

import numpy as np

from arena.game.compiled import home_bonus, is_home, odds, own_strength
from arena.game.state import Rule, Tables, Trait
from arena.game.types import Action
from arena.jit import jit
from policies.search.desk import HITS, MAY_MEET, Desk, near_at
from policies.search.ways import NO_WAY, Ways
from policies.search.worlds import Worlds, as_index

STAY, NORTH, EAST, SOUTH, WEST = (int(action) for action in Action)
_N_ACTIONS = len(Action)
_LOST = 200.0
"""How far a goal is to which no way leads."""
_BLOCKED, _PRIZE = 6.0, 1000.0
"""What it costs to want a friend's cell, and what it is worth to step on the flag, in steps."""


@jit(inline=True)
def aim_at(unit: int, cell: int, desk: Desk) -> None:
    """Note where a unit will stand."""
    desk.aim[unit], desk.then[unit] = cell, desk.place[cell]
    desk.taken[cell] += 1


@jit(inline=True)
def plain_step(cell: int, target: int, word: np.uint64, ways: Ways, tables: Tables, desk: Desk) -> int:
    """Return a step that leads nearer on foot and takes no friend's cell, or STAY."""
    best, least, turn = STAY, int(ways.far[target, cell]), int(word & np.uint64(3))
    for k in range(_N_ACTIONS - 1):
        action = 1 + (k + turn) % 4
        to = as_index(tables.neighbour[action, cell])
        far = int(ways.far[target, to])
        is_better = (far < least) & (desk.taken[to] == 0)
        best, least = action if is_better else best, far if is_better else least
    return best


@jit(inline=True)
def may_meet(unit: int, n_seen: int, desk: Desk) -> bool:
    """Whether a unit and an enemy in sight, each after a step, may be in reach of each other."""
    bits, place = 0, desk.at[unit]
    for k in range(n_seen):
        enemy = as_index(desk.seen[k])
        bits |= near_at(desk.eye[enemy] - place, desk)
    return bits & MAY_MEET != 0


@jit(inline=True)
def weigh_enemies(world: int, team: int, first: int, last: int, n_seen: int, worlds: Worlds, tables: Tables, desk: Desk) -> None:
    """Note what one more unit in reach of each enemy in sight is worth."""
    strength = int(desk.strength[first])
    for k in range(n_seen):
        enemy = as_index(desk.seen[k])
        place = desk.at[enemy]
        ours, theirs = 0, int(own_strength(desk.strength[enemy], tables.rule[Rule.SELF_COUNTS]))
        for number in range(first, last):
            unit = as_index(number)
            hits = near_at(desk.eye[unit] - place, desk) & HITS
            ours += desk.strength[unit] if hits else 0
        for j in range(n_seen):
            other = as_index(desk.seen[j])
            hits = near_at(desk.eye[other] - place, desk) & HITS
            theirs += desk.strength[other] if hits and j != k else 0
        at_home = is_home(worlds.state.ground[world, as_index(worlds.state.cell[world, enemy])], 1 - team)
        bonus, against = float(home_bonus(not at_home)), float(theirs + home_bonus(at_home))
        for is_counted in range(2):
            others = float(max(ours - strength * is_counted, 0))
            without = odds(others + bonus, against) if others > 0.0 else 0.0
            desk.gain[k, is_counted] = odds(others + strength + bonus, against) - without


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
    ground, cell, turn = worlds.state.ground, as_index(worlds.state.cell[world, unit]), int(word & np.uint64(3))
    own, eye = desk.own[unit], desk.eye[unit]
    for k in range(n_seen):
        hits = near_at(eye - desk.at[as_index(desk.seen[k])], desk) & HITS
        desk.worth[k] = desk.gain[k, 1] if hits else desk.gain[k, 0]
    desk.then[unit] = desk.gone[team]
    best, least, aim = STAY, 1e9, cell
    for k in range(_N_ACTIONS):
        action = STAY if k == 0 else 1 + (k + turn) % 4
        to = as_index(tables.neighbour[action, cell])
        if action != STAY and (to == cell or ways.open[to] != to):
            continue
        far, place = int(ways.far[target, to]), desk.place[to]
        cost = float(far) if far != NO_WAY else _LOST
        against, kills = 0.0, 0.0
        for j in range(n_seen):
            enemy = as_index(desk.seen[j])
            likely = desk.likely[near_at(desk.eye[enemy] - place, desk) >> 1]
            against += likely * desk.strength[enemy]
            kills += likely * desk.worth[j]
        if against > 0.0:
            at_home = is_home(ground[world, to], team)
            force = int(own_strength(desk.strength[unit], tables.rule[Rule.SELF_COUNTS])) + int(home_bonus(at_home))
            for number in range(first, last):
                friend = as_index(number)
                hits = near_at(own + desk.then[friend] - place, desk) & HITS
                force += desk.strength[friend] if hits else 0
            if tables.rule[Rule.RANDOM_COMBAT]:
                against += home_bonus(not at_home)
                cost += life * (odds(against, float(force)) - kills)
            else:
                cost += life * ((0.0 if at_home else 1.0) - kills)
        for _ in range(desk.taken[to]):
            cost += _BLOCKED
        if to == prize:
            cost -= _PRIZE
        if cost < least:
            best, least, aim = action, cost, to
    aim_at(unit, aim, desk)
    return best


@jit(inline=True)
def fly_to(unit: int, cell: int, goal: int, tables: Tables) -> int:
    """Return the action that takes a unit that flies nearer to a cell, or STAY where none does."""
    down, right = tables.place[goal, 0] - tables.place[cell, 0], tables.place[goal, 1] - tables.place[cell, 1]
    near = tables.unit[unit, Trait.STEP] // 2
    if abs(down) > abs(right):
        return STAY if abs(down) <= near else SOUTH if down > 0 else NORTH
    return STAY if abs(right) <= near else EAST if right > 0 else WEST
