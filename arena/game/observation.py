"""What a team knows, as data: its own units, the cells in its sight, and the public facts.

`Observation` is what one seat is told at one tick, and what a bot's `act` receives. `Observations` is the same for a
batch of seats of one team, as arrays, for policies that think about a thousand matches at once.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from arena.game.rules import can_enter, column_after, is_home, is_on_board, row_after
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, UAVS, UGVS, Action, Team

if TYPE_CHECKING:
    from numpy.random import Generator

Board = NDArray[np.int8]
"""int8, shape (side, side): one `Code` per cell."""
NO_CLOCK_MS = 0xFFFFFFFF
"""Stands where no clock runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnUnit:
    """One of the team's own units; a fallen one is where it fell."""

    index: int
    type: str
    row: int
    column: int
    alive: bool
    flies: bool


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class EnemyUnit:
    """An enemy unit in sight. It has no index: two of a type cannot be told apart."""

    row: int
    column: int
    type: str
    flies: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """What one team knows at one tick."""

    tick: int
    """Ticks played so far."""
    team: Team
    ground: Board
    """What lies on each cell in sight, units apart: half, flag or obstacle; HIDDEN elsewhere. Read-only."""
    units: tuple[OwnUnit, ...]
    enemies: tuple[EnemyUnit, ...]
    """Those in sight, by row, then column."""
    living: tuple[int, int]
    """Living units of the own team, and of the enemy. Public by rule."""
    score: int
    """The own score, in -100 .. 100. Public by rule."""
    clock_s: float | None
    """Extra time that this seat has left in this match, in seconds; None where no clock runs."""
    seed: int
    """A fresh 64-bit number at each tick, for this seat alone: the only randomness that replays."""

    @property
    def grid(self) -> Board:
        """The paper's Table 2 board: UGV over UAV over flag over obstacle over half; own UAVs over the enemy's."""
        board = self.ground.copy()
        flying = [(unit.row, unit.column, UAVS[self.team.other]) for unit in self.enemies if unit.flies]
        flying += [(unit.row, unit.column, UAVS[self.team]) for unit in self.units if unit.flies and unit.alive]
        walking = [(unit.row, unit.column, UGVS[self.team.other]) for unit in self.enemies if not unit.flies]
        walking += [(unit.row, unit.column, UGVS[self.team]) for unit in self.units if not unit.flies and unit.alive]
        for row, column, code in flying + walking:
            board[row, column] = code
        return board

    @property
    def rng(self) -> "Generator":
        """A generator seeded with `seed`; each access gives a fresh one."""
        return np.random.default_rng(self.seed)

    @property
    def legal_actions(self) -> NDArray[np.bool_]:
        """bool, shape (units, actions): which orders can move a unit, as far as its team knows; staying always may."""
        side = len(self.ground)
        cells = np.array([[unit.row * side + unit.column for unit in self.units]], np.int64)
        alive = np.array([[unit.alive for unit in self.units]], np.bool_)
        flies = np.array([unit.flies for unit in self.units], np.bool_)
        legal: NDArray[np.bool_] = find_legal_actions(self.ground.reshape(1, -1), side, cells, alive, flies)[0]
        return legal

    def find_flag(self, team: Team) -> tuple[int, int] | None:
        """Return (row, column) of a team's flag, or None while it is out of sight."""
        places = np.argwhere(self.ground == FLAGS[team])
        return (int(places[0, 0]), int(places[0, 1])) if len(places) else None

    def is_own_half(self, row: int, column: int) -> bool:
        """Whether a cell in sight lies on the own half."""
        return bool(is_home(self.ground[row, column], self.team))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observations:
    """The observations of a batch of seats, all of one team, as arrays with a leading axis of `n` seats.

    The arrays belong to the venue: they change at the next tick, so a policy that wants to remember copies.
    """

    team: Team
    side: int
    tick: NDArray[np.int32]
    """Shape (n,)."""
    ground: NDArray[np.int8]
    """Shape (n, stride): the cells of `Observation.ground` row by row; past side * side it means nothing."""
    cell: NDArray[np.int16]
    """Shape (n, own units): row * side + column of each own unit."""
    alive: NDArray[np.uint8]
    """Shape (n, own units)."""
    enemy_cell: NDArray[np.int16]
    """Shape (n, enemy units): those in sight by cell and type, then -1."""
    enemy_flies: NDArray[np.uint8]
    """Shape (n, enemy units): beside `enemy_cell`."""
    enemy_type: NDArray[np.int8]
    """Shape (n, enemy units): index into `Ruleset.units`, beside `enemy_cell`; -1 after the last."""
    living: NDArray[np.int16]
    """Shape (n, 2): own, enemy."""
    score: NDArray[np.int16]
    """Shape (n,): the own score."""
    seed: NDArray[np.uint64]
    """Shape (n,)."""
    clock_ms: NDArray[np.uint32]
    """Shape (n,): the extra time that the seat has left, or `NO_CLOCK_MS`."""

    def __len__(self) -> int:
        return len(self.tick)

    def select(self, seats: Any) -> "Observations":
        """Return the observations of some seats: a slice shares memory, an index array copies."""
        return Observations(
            team=self.team, side=self.side, tick=self.tick[seats], ground=self.ground[seats], cell=self.cell[seats],
            alive=self.alive[seats], enemy_cell=self.enemy_cell[seats], enemy_flies=self.enemy_flies[seats],
            enemy_type=self.enemy_type[seats], living=self.living[seats], score=self.score[seats], seed=self.seed[seats],
            clock_ms=self.clock_ms[seats],
        )  # fmt: skip

    def seat(self, seat: int, ruleset: Ruleset) -> Observation:
        """Return a copy of one seat's observation as a bot gets it."""
        side, clock_ms = self.side, int(self.clock_ms[seat])
        ground = self.ground[seat, : side * side].reshape(side, side).copy()
        ground.flags.writeable = False
        own = zip(ruleset.team(self.team), self.cell[seat].tolist(), self.alive[seat].tolist(), strict=True)
        in_sight = [
            (cell, ruleset.units[kind])
            for cell, kind in zip(self.enemy_cell[seat].tolist(), self.enemy_type[seat].tolist(), strict=True)
            if cell >= 0
        ]
        return Observation(
            tick=int(self.tick[seat]),
            team=self.team,
            ground=ground,
            units=tuple(
                OwnUnit(index=index, type=kind.name, row=cell // side, column=cell % side, alive=bool(alive), flies=kind.flies)
                for index, (kind, cell, alive) in enumerate(own)
            ),
            enemies=tuple(
                EnemyUnit(row=cell // side, column=cell % side, type=kind.name, flies=kind.flies) for cell, kind in in_sight
            ),
            living=(int(self.living[seat, 0]), int(self.living[seat, 1])),
            score=int(self.score[seat]),
            clock_s=None if clock_ms == NO_CLOCK_MS else clock_ms / 1000,
            seed=int(self.seed[seat]),
        )


def find_legal_actions(
    ground: NDArray[np.int8], side: int, cell: NDArray[Any], alive: NDArray[Any], flies: NDArray[Any]
) -> NDArray[np.bool_]:
    """Return which orders can move a unit, as far as its team knows; staying always may.

    Parameters
    ----------
    ground
        Shape (n, stride), as `Observations.ground`.
    cell, alive
        Shape (n, units).
    flies
        Shape (units,).

    Returns
    -------
    ndarray
        bool, shape (n, units, actions).
    """
    legal = np.zeros((*cell.shape, len(Action)), np.bool_)
    legal[..., Action.STAY] = True
    seats = np.arange(len(cell))[:, None]
    for action in tuple(Action)[1:]:
        row, column = row_after(cell // side, action), column_after(cell % side, action)
        is_there = is_on_board(row, column, side)
        target = np.where(is_there, row * side + column, 0)
        legal[..., action] = alive.astype(np.bool_) & is_there & can_enter(ground[seats, target], flies)
    return legal
