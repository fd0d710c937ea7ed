"""Where the units of a world stand and what a team sees of it, laid out for the orders of one tick."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import is_home
from arena.game.engine import tables_of
from arena.game.rules import is_in_reach, is_in_sight, squared_distance
from arena.game.ruleset import MAX_UNITS, Ruleset
from arena.game.state import Rule, StateField, Tables, Trait
from arena.game.types import Team
from arena.jit import jit
from policies.search.worlds import Worlds, as_index, units_of

_BEHIND = 0.35
"""How far behind the border units hold, as a share of the board."""
N_SEARCHES = 4
SEES, HITS, MAY_HIT, MAY_MEET = 1, 2, 4, 8
"""Bits of `Desk.near`: that a unit sees a place; that it hits there; that it does after a step along the longer way; that it or
who stands there, each after a step, may be in reach of the other."""


class Desk(NamedTuple):
    """Scratch for the orders of a world, and what the rules and the halves say of each unit.

    A place is a cell's number on a board of twice as many columns, so that the difference of two says how they lie.
    """

    ahead: NDArray[np.int64]
    """Shape (2 teams,): 1 where the enemy's half is the eastern one, else -1."""
    lane: NDArray[np.int64]
    """Shape (2 teams, 16): the cell in which each unit holds a lane."""
    search: NDArray[np.int64]
    """Shape (2 teams, 16, 4): the cells where each unit looks, by turns, for a flag that its team does not know."""
    place: NDArray[np.int64]
    """Shape (cells,): the place of each cell."""
    shown: NDArray[np.int64]
    """Shape (2 teams,): 1 where a team sees everything, as without fog."""
    gone: NDArray[np.int64]
    """Shape (2 teams,): the place of the fallen, from which everything is far."""
    near: NDArray[np.int8]
    """What a unit can do at a place, at `own[unit]` and the difference of the places."""
    own: NDArray[np.int64]
    """Shape (units,)."""
    strength: NDArray[np.int64]
    """Shape (units,)."""
    at: NDArray[np.int64]
    """Shape (units,): the places where units stand."""
    eye: NDArray[np.int64]
    """Shape (units,): the same and `own[unit]`."""
    then: NDArray[np.int64]
    """Shape (units,): where they will, as far as decided, else where they stand."""
    aim: NDArray[np.uint16]
    """Shape (units,): the cell where a unit on foot will stand, as far as decided; else that after the last."""
    taken: NDArray[np.int8]
    """Shape (cells + 1,): how many units of the team want to stand there; zeros between two calls."""
    target: NDArray[np.uint16]
    """Shape (units,): the cell to which a unit's role leads if no enemy is in sight; as the next three."""
    life: NDArray[np.float64]
    """What a life is worth to it, in steps."""
    seeks: NDArray[np.int64]
    """Which enemy in sight it goes for."""
    wanders: NDArray[np.int64]
    """The role of a unit that takes a new target as it goes, or orders at random; else -1."""
    seen: NDArray[np.uint16]
    """Shape (16,): the enemies on foot in sight, as units."""
    gain: NDArray[np.float64]
    """Shape (16, 2): by how much one more unit in reach of each enemy raises the chance that it falls: one that is not, and one
    that is in reach of it now."""
    worth: NDArray[np.float64]
    """Shape (16,): what each in sight is worth to one unit."""
    likely: NDArray[np.float64]
    """Shape (8,): how likely an enemy is to hit, by its bits of `near`."""


_STEPS_UP = 0.5
"""How likely an enemy that must step up for a fight is taken to do so."""


def make_desk(ruleset: Ruleset) -> Desk:
    """Return scratch; `set_posts` writes what depends on the halves."""
    tables, side = tables_of(ruleset), ruleset.side
    units = [unit for team in Team for unit in ruleset.team(team)]
    apart = np.arange(-(side - 1), side)
    down, right = np.abs(apart)[:, None], np.abs(apart)
    longer, shorter = np.maximum(down, right), np.minimum(down, right)
    squared = squared_distance(down, right)
    near = np.zeros((len(ruleset.units), 8 * side + 1, 2 * side), np.int8)
    for unit, kind in zip(units, tables.unit, strict=True):
        reach = kind[Trait.REACH]
        hits, may_hit = is_in_reach(squared, reach), is_in_reach(squared_distance(longer - 1, shorter), reach)
        may_meet = is_in_reach(squared_distance(longer - 1, shorter - 1), reach) | (longer <= 1)
        may_meet |= is_in_reach(squared_distance(longer - 2, shorter), reach)
        bits = SEES * is_in_sight(squared, unit.sight) + HITS * hits + MAY_HIT * may_hit + MAY_MEET * may_meet
        flat = near[kind[Trait.TYPE]].reshape(-1)
        flat[8 * side * side + 2 * side * apart[:, None] + apart] = bits
    cells = np.arange(side * side)

    def zeros(*shape: int) -> NDArray[np.int64]:
        return np.zeros(shape, np.int64)

    return Desk(
        ahead=zeros(2), lane=zeros(2, MAX_UNITS), search=zeros(2, MAX_UNITS, N_SEARCHES),
        place=cells + cells // side * side, shown=np.full(2, int(not ruleset.fog), np.int64),
        gone=np.array([4, -4], np.int64) * side * side, near=near.reshape(-1),
        own=tables.unit[:, Trait.TYPE] * near[:1].size + 8 * side * side, strength=tables.unit[:, Trait.STRENGTH].copy(),
        at=zeros(len(units)), eye=zeros(len(units)), then=zeros(len(units)), aim=np.zeros(len(units), np.uint16),
        taken=np.zeros(side * side + 1, np.int8), target=np.zeros(len(units), np.uint16), life=np.zeros(len(units)),
        seeks=zeros(len(units)), wanders=zeros(len(units)), seen=np.zeros(MAX_UNITS, np.uint16),
        gain=np.zeros((MAX_UNITS, 2)), worth=np.zeros(MAX_UNITS), likely=np.array([0, 0, _STEPS_UP, 1.0] * 2),
    )  # fmt: skip


def set_posts(desk: Desk, ruleset: Ruleset, team: Team, forward: int) -> None:
    """Write where units hold and search, as soon as a seat of `team` knows which way the enemy lies: `Belief.forward`."""
    side = ruleset.side
    for other in Team:
        ahead = forward if other is team else -forward
        n_walkers = sum(not unit.flies for unit in ruleset.team(other))
        desk.ahead[other] = ahead
        for unit in range(MAX_UNITS):
            behind = int(_BEHIND * side)
            desk.lane[other, unit] = (1 + 2 * (unit % 2)) * side // 4 * side
            desk.lane[other, unit] += side // 2 - behind if ahead > 0 else side // 2 - 1 + behind
            for turn in range(N_SEARCHES):
                row = ((2 * unit + 1) * side // (2 * max(n_walkers, 1)) + turn * (side // 3)) % side
                desk.search[other, unit, turn] = row * side + (side - 1 - side // 6 if ahead > 0 else side // 6)


@jit(inline=True)
def place_units(world: int, worlds: Worlds, tables: Tables, desk: Desk) -> None:
    """Note where the units of a world stand."""
    blue, nowhere = int(tables.rule[Rule.BLUE_UNITS]), desk.taken.shape[0] - 1
    for unit in range(desk.at.shape[0]):
        place = desk.place[as_index(worlds.state.cell[world, unit])]
        if not worlds.state.alive[world, unit]:
            place = desk.gone[0 if unit < blue else 1]
        desk.at[unit], desk.eye[unit], desk.then[unit], desk.aim[unit] = place, desk.own[unit] + place, place, nowhere


@jit(inline=True)
def look(world: int, team: int, worlds: Worlds, tables: Tables, desk: Desk) -> int:
    """Note the enemies on foot that a team sees, and what it learns of flag and raid; return how many they are."""
    state = worlds.state
    first, _, last = units_of(team, tables)
    foe, after_foes, _ = units_of(1 - team, tables)
    is_shown = int(desk.shown[team])
    if not worlds.knows[world, team]:
        flag = as_index(state.field[world, StateField.RED_FLAG - team])
        worlds.knows[world, team] = is_shown | sees(first, last, desk.place[flag], desk)
    found = 0
    for number in range(foe, after_foes):
        enemy = as_index(number)
        if state.alive[world, enemy] and is_shown | sees(first, last, desk.at[enemy], desk):
            desk.seen[found] = enemy
            found += 1
            if is_home(state.ground[world, as_index(state.cell[world, enemy])], team):
                worlds.raided[world, team] = state.field[world, StateField.TICK]
    return found


@jit(inline=True)
def sees(first: int, last: int, place: int, desk: Desk) -> int:
    """Return 1 if one of some units sees a place, else 0."""
    bits = 0
    for unit in range(first, last):
        bits |= near_at(desk.eye[as_index(unit)] - place, desk)
    return bits & SEES


@jit(inline=True)
def near_at(index: int, desk: Desk) -> int:
    """Return what a unit can do at a place: `index` is `own[unit]` and the difference of the places, which is never negative."""
    return int(desk.near[np.uint64(index)])
