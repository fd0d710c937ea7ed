"""What a seat remembers: the ground that it has seen, both flags, and which way the enemy lies.

Arrays have a leading axis of seats. Kernels take them as named tuples, since numba knows those; all memory belongs to the policy.
"""

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team
from arena.jit import jit
from arena.policy import BatchPolicy, Orders

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


class Facts(NamedTuple):
    """What a team knows before the first tick. The last four are codes of a cell."""

    side: int
    flies: NDArray[np.uint8]
    """Shape (own units,)."""
    step: NDArray[np.int64]
    """Shape (own units,): cells per tick."""
    own_half: int
    enemy_half: int
    own_flag: int
    enemy_flag: int


class Memory(NamedTuple):
    """What was seen since the match began."""

    ground: NDArray[np.int8]
    """Shape (seats, cells): as in `Observations`, HIDDEN where never seen."""
    own_flag: NDArray[np.int16]
    """Shape (seats,): its cell, -1 until seen."""
    enemy_flag: NDArray[np.int16]
    forward: NDArray[np.int8]
    """Shape (seats,): 1 where the enemy's half is the eastern one, -1 where it is the western, 0 before the first tick."""
    detour: NDArray[np.int16]
    """Shape (seats, own units): of `moves.head_for`."""
    sent_from: NDArray[np.int16]
    """Shape (seats, own units): the cell from which `pursuit.pursue` last sent the unit on, or -1."""


def sight_of(observations: Observations) -> Sight:
    """Return the arrays of `observations` as kernels take them: contiguous, or numba would compile for every layout."""
    return Sight(
        np.ascontiguousarray(observations.ground),
        np.ascontiguousarray(observations.cell),
        np.ascontiguousarray(observations.alive),
        np.ascontiguousarray(observations.enemy_cell),
        np.ascontiguousarray(observations.enemy_flies),
        np.ascontiguousarray(observations.enemy_type),
        np.ascontiguousarray(observations.tick),
        np.ascontiguousarray(observations.living),
        np.ascontiguousarray(observations.score),
        np.ascontiguousarray(observations.seed),
    )


@jit(inline=True)
def find(ground: Any, seat: int, n_cells: int, code: int) -> int:
    """Return the first cell that shows `code`, or -1."""
    is_there = np.uint8(0)
    for cell in range(n_cells):  # without a way out, so that it runs in vector registers: most often there is none
        is_there |= np.uint8(ground[seat, cell] == code)
    if is_there:
        for cell in range(n_cells):
            if ground[seat, cell] == code:
                return cell
    return -1


@jit()
def remember(seat: int, sight: Any, memory: Any, facts: Any) -> bool:
    """Add what a seat sees to what it remembers; return whether an obstacle was new."""
    n_cells = memory.ground.shape[1]
    is_new = np.uint8(0)
    for cell in range(n_cells):
        seen, known = sight.ground[seat, cell], memory.ground[seat, cell]
        is_new |= np.uint8(seen == _OBSTACLE) & np.uint8(known != _OBSTACLE)
        memory.ground[seat, cell] = known if seen < 0 else seen
    if memory.own_flag[seat] < 0:
        memory.own_flag[seat] = find(sight.ground, seat, n_cells, facts.own_flag)
    if memory.enemy_flag[seat] < 0:
        memory.enemy_flag[seat] = find(sight.ground, seat, n_cells, facts.enemy_flag)
    if memory.forward[seat] == 0:
        memory.forward[seat] = _forward(seat, memory.ground, facts)
    return bool(is_new)


@jit(inline=True)
def _forward(seat: int, ground: Any, facts: Any) -> int:
    """Return 1 if the own half seems to be the western one, else -1."""
    west = 0
    for cell in range(ground.shape[1]):
        code = ground[seat, cell]
        is_own, is_enemy = code in (facts.own_half, facts.own_flag), code in (facts.enemy_half, facts.enemy_flag)
        is_west = 2 * (cell % facts.side) < facts.side
        if is_own or is_enemy:
            west += 1 if is_own == is_west else -1
    return 1 if west > 0 else -1


@jit(inline=True)
def nearest_walker(seat: int, sight: Any, side: int, row: int, column: int) -> int:
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


class RememberingPolicy(BatchPolicy):
    """A fighter with a `Memory`, forgotten when a match begins."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        units = ruleset.team(team)
        self.facts = Facts(
            ruleset.side,
            np.array([unit.flies for unit in units], np.uint8),
            np.array([unit.step for unit in units], np.int64),
            int(HALVES[team]), int(HALVES[team.other]), int(FLAGS[team]), int(FLAGS[team.other]),
        )  # fmt: skip
        self.memory = Memory(
            np.full((n_seats, ruleset.side**2), Code.HIDDEN, np.int8),
            np.full(n_seats, -1, np.int16),
            np.full(n_seats, -1, np.int16),
            np.zeros(n_seats, np.int8),
            np.zeros((n_seats, len(units)), np.int16),
            np.full((n_seats, len(units)), -1, np.int16),
        )
        self._orders = np.zeros((n_seats, len(units)), np.int8)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen there."""
        self.memory.ground[seats] = Code.HIDDEN
        self.memory.own_flag[seats] = -1
        self.memory.enemy_flag[seats] = -1
        self.memory.forward[seats] = 0
        self.memory.detour[seats] = 0
        self.memory.sent_from[seats] = -1

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats."""
        self.decide(sight_of(observations), self._orders)
        orders[:] = self._orders

    @abstractmethod
    def decide(self, sight: Sight, orders: Orders) -> None:
        """Write the orders of all seats into contiguous memory, and remember."""
