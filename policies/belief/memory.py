"""What a seat sees, and what it remembers: the ground, both flags, which way the enemy lies, and what each unit is about.

Arrays have a leading axis of seats. Kernels take them as named tuples, since numba knows those; all memory belongs to the policy.
"""

from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.types import Code
from arena.jit import jit
from policies.belief.team_rules import TeamRules

_OBSTACLE = int(Code.OBSTACLE)


class Sight(NamedTuple):
    """The fields of `Observations` that kernels read."""

    ground: NDArray[np.int8]
    cell: NDArray[np.int16]
    alive: NDArray[np.uint8]
    enemy_cell: NDArray[np.int16]
    enemy_flies: NDArray[np.uint8]
    enemy_type: NDArray[np.int8]
    tick: NDArray[np.int32]
    living: NDArray[np.int16]
    score: NDArray[np.int16]
    seed: NDArray[np.uint64]


class SeatMemory(NamedTuple):
    """What fighters without a `Belief` remember since the match began: the map, and what each unit is about."""

    ground: NDArray[np.int8]
    """Shape (seats, cells): codes of the ground as last seen, HIDDEN where never seen."""
    own_flag: NDArray[np.int16]
    """Shape (seats,): its cell, -1 until seen."""
    enemy_flag: NDArray[np.int16]
    """Shape (seats,)."""
    forward: NDArray[np.int8]
    """Shape (seats,): 1 where the enemy's half is the eastern one, -1 where it is the western, 0 before the first tick."""
    is_map_new: NDArray[np.uint8]
    """Shape (seats,): whether the enemy's flag or an obstacle was found since `to_flag` was written."""
    to_flag: NDArray[np.int16]
    """Shape (seats, cells): steps on foot to the enemy's flag, where a fighter searches for ways."""
    detour: NDArray[np.int16]
    """Shape (seats, own units), as all that follow: of `moves.head_for`."""
    sent_from: NDArray[np.int16]
    """The cell from which `pursuit.pursue` last sent the unit on, or -1."""
    goal: NDArray[np.int16]
    """The cell that the unit is going to, or -1."""
    before: NDArray[np.int16]
    """The cell where the unit last moved by its heading, or -1."""
    heading: NDArray[np.int8]
    """The direction that the unit keeps, STAY before it has one."""
    leg: NDArray[np.int16]
    """Legs of its route that the unit has walked."""
    left: NDArray[np.int16]
    """Steps left of the leg."""
    work: NDArray[np.uint64]
    """Shape (19, 64): scratch of `paths.flood`."""


def make_memory(n_seats: int, n_units: int, n_cells: int) -> SeatMemory:
    """Return memory for some seats, which know nothing yet."""

    def array(*shape: int, kind: type = np.int16) -> NDArray[Any]:
        return np.zeros((n_seats, *shape), kind)

    memory = SeatMemory(
        ground=array(n_cells, kind=np.int8), own_flag=array(), enemy_flag=array(), forward=array(kind=np.int8),
        is_map_new=array(kind=np.uint8), to_flag=array(n_cells), detour=array(n_units), sent_from=array(n_units),
        goal=array(n_units), before=array(n_units), heading=array(n_units, kind=np.int8), leg=array(n_units), left=array(n_units),
        work=np.zeros((19, 64), np.uint64),
    )  # fmt: skip
    forget_memory(memory, np.arange(n_seats))
    return memory


def forget_memory(memory: SeatMemory, seats: NDArray[np.intp]) -> None:
    """Make some seats know nothing."""
    memory.ground[seats] = Code.HIDDEN
    for unknown in (memory.own_flag, memory.enemy_flag, memory.sent_from, memory.goal, memory.before):
        unknown[seats] = -1
    for none in (memory.forward, memory.is_map_new, memory.detour, memory.heading, memory.leg, memory.left):
        none[seats] = 0


_sight_fields = attrgetter(*Sight._fields)


def sight_of(observations: Observations) -> Sight:
    """Return the arrays of `observations` as kernels take them: contiguous, or numba would compile for every layout."""
    return Sight(*map(np.ascontiguousarray, _sight_fields(observations)))


@jit(inline=True)
def find(ground: NDArray[np.int8], seat: int, n_cells: int, code: int) -> int:
    """Return the first cell that shows `code`, or -1. What is not cast to a byte, numba makes eight bytes of."""
    is_there, wanted = np.uint8(0), np.int8(code)
    for cell in range(n_cells):  # without a way out, so that it runs in vector registers: most often there is none
        is_there = np.uint8(is_there | np.uint8(ground[seat, cell] == wanted))
    if is_there:
        for cell in range(n_cells):
            if ground[seat, cell] == code:
                return cell
    return -1


@jit()
def remember(
    seat: int,
    sight: Sight,
    ground: NDArray[np.int8],
    own_flag: NDArray[np.int16],
    enemy_flag: NDArray[np.int16],
    forward: NDArray[np.int8],
    rules: TeamRules,
) -> bool:
    """Add what a seat sees to its map; return whether an obstacle was new.

    Parameters
    ----------
    ground, own_flag, enemy_flag, forward
        As in `SeatMemory`; written.
    """
    n_cells = ground.shape[1]
    is_new = np.uint8(0)
    for cell in range(n_cells):
        seen, known = sight.ground[seat, cell], ground[seat, cell]
        is_new = np.uint8(is_new | np.uint8((seen == _OBSTACLE) & (known != _OBSTACLE)))
        ground[seat, cell] = known if seen < 0 else seen
    if own_flag[seat] < 0:
        own_flag[seat] = find(sight.ground, seat, n_cells, rules.own_flag)
    if enemy_flag[seat] < 0:
        enemy_flag[seat] = find(sight.ground, seat, n_cells, rules.enemy_flag)
    if forward[seat] == 0:
        forward[seat] = _forward(seat, ground, rules)
    return bool(is_new)


@jit(inline=True)
def _forward(seat: int, ground: NDArray[np.int8], rules: TeamRules) -> int:
    """Return 1 if the own half seems to be the western one, else -1."""
    west = 0
    for row in range(rules.side):
        for column in range(rules.side):
            code = ground[seat, row * rules.side + column]
            own, enemy = (
                (code == rules.own_half) | (code == rules.own_flag),
                (code == rules.enemy_half) | (code == rules.enemy_flag),
            )
            west += (int(own) - int(enemy)) * (1 if 2 * column < rules.side else -1)
    return 1 if west > 0 else -1


@jit(inline=True)
def nearest_walker(seat: int, sight: Sight, side: int, row: int, column: int) -> int:
    """Return the cell of the nearest enemy in sight that walks, or -1; of several, the first."""
    nearest, least = -1, 2 * side
    for enemy in range(sight.enemy_cell.shape[1]):
        cell = int(sight.enemy_cell[seat, enemy])
        if cell < 0:
            break
        distance = abs(cell // side - row) + abs(cell % side - column)
        if not sight.enemy_flies[seat, enemy] and distance < least:
            nearest, least = cell, distance
    return nearest
