"""Where the units of a world stand and what a team sees of it, laid out for the orders of one tick."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import is_home, is_in_sight, squared_distance
from arena.game.ruleset import MAX_UNITS, Ruleset
from arena.game.state import Rule, StateField, Tables, Trait
from arena.game.types import Team
from arena.jit import jit
from policies.search.worlds import Worlds, units_of

_BEHIND = 0.35
"""How far behind the border units hold, as a share of the board."""
N_SEARCHES = 4
CELL, ROW, COLUMN = range(3)
"""Last index of `Desk.seen` and `Desk.aim`."""


class Desk(NamedTuple):
    """Scratch for the orders of a world, and what the rules and the halves say of each unit."""

    ahead: NDArray[np.int64]
    """Shape (2 teams,): 1 where the enemy's half is the eastern one, else -1."""
    sight: NDArray[np.int64]
    """Shape (units,)."""
    lane: NDArray[np.int64]
    """Shape (2 teams, 16): the cell in which each unit holds a lane."""
    search: NDArray[np.int64]
    """Shape (2 teams, 16, 4): the cells where each unit looks, by turns, for a flag that its team does not know."""
    row: NDArray[np.int64]
    """Shape (units,): where units stand, as the next."""
    column: NDArray[np.int64]
    living: NDArray[np.int64]
    """Shape (units,): 1 or 0."""
    seen: NDArray[np.int64]
    """Shape (16, 3): cell, row and column of each enemy on foot in sight."""
    reach: NDArray[np.int64]
    """Shape (16,): their reach, as the next."""
    might: NDArray[np.int64]
    """Their strength."""
    gain: NDArray[np.float64]
    """Shape (16, 2): by how much one more unit in reach of each raises the chance that it falls: one that is not, and one that is
    in reach of it now."""
    aim: NDArray[np.int64]
    """Shape (32, 3): cell, row and column where each own unit will stand, as far as decided; a cell of -1 where not."""


def make_desk(ruleset: Ruleset) -> Desk:
    """Return scratch; `set_posts` writes what depends on the halves."""
    sight = np.array([unit.sight for team in Team for unit in ruleset.team(team)], np.int64)

    def zeros(*shape: int) -> NDArray[np.int64]:
        return np.zeros(shape, np.int64)

    return Desk(
        ahead=zeros(2), sight=sight, lane=zeros(2, MAX_UNITS), search=zeros(2, MAX_UNITS, N_SEARCHES), row=zeros(len(sight)),
        column=zeros(len(sight)), living=zeros(len(sight)), seen=zeros(MAX_UNITS, 3), reach=zeros(MAX_UNITS),
        might=zeros(MAX_UNITS), gain=np.zeros((MAX_UNITS, 2)), aim=zeros(2 * MAX_UNITS, 3),
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
    for unit in range(desk.row.shape[0]):
        cell = worlds.state.cell[world, unit]
        desk.row[unit], desk.column[unit] = tables.place[cell, 0], tables.place[cell, 1]
        desk.living[unit] = worlds.state.alive[world, unit]


@jit(inline=True)
def look(world: int, team: int, worlds: Worlds, tables: Tables, desk: Desk) -> int:
    """Note the enemies on foot that a team sees, and what it learns of flag and raid; return how many they are."""
    state = worlds.state
    first, _, last = units_of(team, tables)
    foe, after_foes, _ = units_of(1 - team, tables)
    is_open = tables.rule[Rule.FOG] == 0
    if not worlds.knows[world, team]:
        flag = state.field[world, StateField.RED_FLAG - team]
        worlds.knows[world, team] = is_open or _sees(first, last, tables.place[flag, 0], tables.place[flag, 1], desk)
    found = 0
    for enemy in range(foe, after_foes):
        row, column = desk.row[enemy], desk.column[enemy]
        if desk.living[enemy] and (is_open or _sees(first, last, row, column, desk)):
            cell = int(state.cell[world, enemy])
            desk.seen[found, CELL], desk.seen[found, ROW], desk.seen[found, COLUMN] = cell, row, column
            desk.reach[found], desk.might[found] = tables.unit[enemy, Trait.REACH], tables.unit[enemy, Trait.STRENGTH]
            found += 1
            if is_home(state.ground[world, cell], team):
                worlds.raided[world, team] = state.field[world, StateField.TICK]
    return found


@jit(inline=True)
def _sees(first: int, last: int, row: int, column: int, desk: Desk) -> bool:
    """Whether one of some units sees a cell."""
    is_seen = False
    for unit in range(first, last):
        near = is_in_sight(squared_distance(desk.row[unit] - row, desk.column[unit] - column), desk.sight[unit])
        is_seen |= near & (desk.living[unit] != 0)
    return is_seen
