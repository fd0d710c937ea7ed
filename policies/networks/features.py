"""What the `team` network sees: the board as planes, in a frame where the enemy's half is always the eastern one.

One call encodes a batch of seats. Nothing but observations goes in; what earlier ones showed is in each seat's belief
(`policies.belief.belief`). Planes are uint8 with `ONE` standing for 1.0, so that a rollout takes a quarter of its size in floats;
they are laid out with the planes last, as the network reads them.
"""

from enum import IntEnum
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter, column_after, is_in_reach, is_on_board, row_after, squared_distance
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.jit import jit
from policies.belief.belief import Belief, forget, make_belief
from policies.belief.bitrows import count, has
from policies.belief.memory import Sight, sight_of
from policies.belief.team_rules import TeamRules, team_rules
from policies.belief.update import update

FEATURES_VERSION = 1
"""Rises whenever the same observations would give other planes: a checkpoint is refused by another version."""
ONE = 32
_MOST, _FAR = 255, 63
Integer = TypeVar("Integer", bound=np.integer[Any])
_STAY = int(Action.STAY)
_MIRRORED = np.array([Action.STAY, Action.NORTH, Action.WEST, Action.SOUTH, Action.EAST], np.int8)
UPSIDE_DOWN = np.array([Action.STAY, Action.SOUTH, Action.EAST, Action.NORTH, Action.WEST], np.int8)
"""Each action with north and south exchanged."""


class Plane(IntEnum):
    """Planes of the encoded board."""

    ON_BOARD = 0
    OBSTACLE = 1
    OWN_HALF = 2
    VISIBLE = 3
    AGE = 4
    """Ticks since a cell was last in sight, an eighth each; as old as can be where it never was."""
    OWN_UGV = 5
    OWN_UAV = 6
    ENEMY_UGV = 7
    ENEMY_UAV = 8
    ENEMY_MAY_BE = 9
    """Where an enemy on foot may stand, as far as anybody can tell."""
    ENEMY_DENSITY = 10
    """How many are to be expected there, eightfold, if each stands anywhere in its set alike."""
    OWN_FLAG = 11
    ENEMY_FLAG = 12
    OWN_FLAG_MAY_BE = 13
    ENEMY_FLAG_MAY_BE = 14
    OWN_STRENGTH = 15
    """Strength of own units that could hit an enemy on the cell."""
    ENEMY_STRENGTH = 16
    TO_ENEMY_FLAG = 17
    """Steps to where the enemy's flag is, or to the nearest cell where it may be, an eighth each."""
    TO_OWN_FLAG = 18


FIRST_DISTANCE = Plane.TO_ENEMY_FLAG
"""This plane and those after it are distances: near a unit, only their differences matter."""


class Scalar(IntEnum):
    """What is known of the match as a whole."""

    TIME = 0
    TIME_LEFT = 1
    OWN_WALKERS = 2
    ENEMY_WALKERS = 3
    LEAD = 4
    SCORE = 5
    ENEMY_FLAG_FOUND = 6
    OWN_FLAG_FOUND = 7
    FLAG_CELLS = 8
    """Share of a half in which the enemy's flag may lie."""


N_PLANES, N_SCALARS = len(Plane), len(Scalar)


class Encoded(NamedTuple):
    """A batch of encoded seats, in memory that the next call overwrites."""

    planes: NDArray[np.uint8]
    """Shape (n, side, side, N_PLANES)."""
    scalars: NDArray[np.float32]
    """Shape (n, N_SCALARS)."""
    cell: NDArray[np.int64]
    """Shape (n, units): row * side + column of each own unit, in the frame."""
    alive: NDArray[np.uint8]
    """Shape (n, units)."""
    legal: NDArray[np.uint8]
    """Shape (n, units, actions): which actions of the frame can move a unit, as far as its team knows; STAY always may."""


def upside_down(encoded: Encoded) -> Encoded:
    """Return a copy with the boards mirrored north to south."""
    return encoded._replace(
        planes=np.ascontiguousarray(encoded.planes[:, ::-1]),
        cell=cells_upside_down(encoded.cell, encoded.planes.shape[1]),
        legal=encoded.legal[..., UPSIDE_DOWN],
    )


def cells_upside_down(cell: NDArray[Integer], side: int) -> NDArray[Integer]:
    """Return cells mirrored north to south, of the same shape."""
    row, column = np.divmod(cell, side)
    return (side - 1 - row) * side + column


def actions_upside_down(actions: NDArray[Integer]) -> NDArray[Integer]:
    """Return actions with north and south exchanged, of the same shape; what is negative is none, and stays."""
    return np.where(actions < 0, actions, UPSIDE_DOWN[actions]).astype(actions.dtype)


def prepare_encoder(ruleset: Ruleset) -> None:
    """Compile, or load, what an encoder needs."""
    Encoder(ruleset, Team.BLUE, 1).encode(Observations.blank(ruleset, Team.BLUE, 1))


class Encoder:
    """Encodes the observations of a batch of seats of one team, and keeps a belief for each."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        side, units = ruleset.side, ruleset.team(team)
        self._rules = team_rules(ruleset, team)
        self._belief = make_belief(ruleset, team, n_seats)
        self._out = Encoded(
            np.zeros((n_seats, side, side, N_PLANES), np.uint8),
            np.zeros((n_seats, N_SCALARS), np.float32),
            np.zeros((n_seats, len(units)), np.int64),
            np.zeros((n_seats, len(units)), np.uint8),
            np.zeros((n_seats, len(units), len(Action)), np.uint8),
        )

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what `seats` believe: a new match begins there."""
        forget(self._belief, seats)

    def encode(self, observations: Observations) -> Encoded:
        """Take in one tick of every seat, and return the planes."""
        sight = sight_of(observations)
        update(sight, self._belief, self._rules)
        _encode(sight, self._belief, self._rules, self._out)
        return self._out

    def to_board(self, actions: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return actions of the frame, shape (n, units), as orders on the board, or orders as actions of the frame."""
        return np.where(self.is_turned[:, None], mirror(actions), actions)

    @property
    def is_turned(self) -> NDArray[np.bool_]:
        """Shape (n_seats,): whether the frame is the board's mirror image."""
        return self._belief.forward < 0


def mirror(actions: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return actions with east and west exchanged."""
    return _MIRRORED[actions]


@jit(inline=True)
def framed(cell: int, side: int, is_turned: bool) -> int:
    """Return the number of a cell in the frame."""
    return cell + side - 1 - 2 * (cell % side) if is_turned else cell


@jit(inline=True)
def _eighths(steps: int) -> int:
    return ONE // 8 * min(steps, _FAR)


@jit(inline=True)
def _strike(planes: NDArray[np.uint8], plane: int, cell: int, reach: int, strength: int, side: int) -> None:
    """Add a unit's strength to every cell in its attack range."""
    row, column = cell // side, cell % side
    radius = 0
    while is_in_reach(squared_distance(radius + 1, 0), reach):
        radius += 1
    for there in range(max(row - radius, 0), min(row + radius + 1, side)):
        for beside in range(max(column - radius, 0), min(column + radius + 1, side)):
            if is_in_reach(squared_distance(there - row, beside - column), reach):
                planes[there, beside, plane] = min(planes[there, beside, plane] + ONE * strength, _MOST)


@jit(inline=True)
def _draw_ground(seat: int, belief: Belief, side: int, planes: NDArray[np.uint8], is_turned: bool) -> None:
    """Write the planes of the ground, the flags and the distances."""
    tick, own_flag, enemy_flag = belief.tick[seat], belief.own_flag[seat], belief.enemy_flag[seat]
    for cell in range(side * side):
        there = framed(cell, side, is_turned)
        here = planes[there // side, there % side]
        seen_at = belief.seen_at[seat, cell]
        here[Plane.ON_BOARD] = ONE
        here[Plane.OBSTACLE] = ONE * (not can_enter(belief.ground[seat, cell], 0))
        here[Plane.OWN_HALF] = ONE * (2 * (there % side) < side)
        here[Plane.VISIBLE] = ONE * (seen_at == tick)
        here[Plane.AGE] = _eighths(tick - seen_at) if seen_at >= 0 else _MOST
        for plane in range(Plane.OWN_UGV, Plane.ENEMY_UAV + 1):
            here[plane] = 0
        here[Plane.OWN_STRENGTH] = here[Plane.ENEMY_STRENGTH] = 0
        here[Plane.OWN_FLAG] = ONE * (cell == own_flag)
        here[Plane.ENEMY_FLAG] = ONE * (cell == enemy_flag)
        here[Plane.OWN_FLAG_MAY_BE] = ONE * (own_flag < 0 and has(belief.home_rows[seat], side, cell))
        here[Plane.ENEMY_FLAG_MAY_BE] = ONE * (enemy_flag < 0 and has(belief.flag_rows[seat], side, cell))
        here[Plane.TO_ENEMY_FLAG] = _eighths(belief.to_flag[seat, cell])
        here[Plane.TO_OWN_FLAG] = _eighths(belief.to_home[seat, cell])


@jit(inline=True)
def _draw_tracks(seat: int, belief: Belief, side: int, planes: NDArray[np.uint8], is_turned: bool) -> None:
    """Write where enemies on foot may be."""
    planes[:, :, Plane.ENEMY_MAY_BE : Plane.ENEMY_DENSITY + 1] = 0
    for enemy in range(belief.enemy_cell.shape[1]):
        rows = belief.enemy_rows[seat, enemy]
        n_cells = count(rows, side)
        if n_cells == 0:
            continue
        share = max(8 * ONE // n_cells, 1)
        for cell in range(side * side):
            if has(rows, side, cell):
                there = framed(cell, side, is_turned)
                here = planes[there // side, there % side]
                here[Plane.ENEMY_MAY_BE] = ONE
                here[Plane.ENEMY_DENSITY] = min(here[Plane.ENEMY_DENSITY] + share, _MOST)


@jit(inline=True)
def _draw_units(seat: int, sight: Sight, belief: Belief, rules: TeamRules, out: Encoded, is_turned: bool) -> int:
    """Write the planes of the units, and what each of the own may do; return how many of the own walk and live."""
    side, planes, n_walkers = rules.side, out.planes[seat], 0
    for enemy in range(sight.enemy_cell.shape[1]):
        if sight.enemy_cell[seat, enemy] < 0:
            break
        cell, kind = framed(int(sight.enemy_cell[seat, enemy]), side, is_turned), sight.enemy_type[seat, enemy]
        planes[cell // side, cell % side, Plane.ENEMY_UAV if sight.enemy_flies[seat, enemy] else Plane.ENEMY_UGV] += ONE
        if not sight.enemy_flies[seat, enemy]:
            _strike(planes, Plane.ENEMY_STRENGTH, cell, rules.type_reach[kind], rules.type_strength[kind], side)
    for unit in range(len(rules.flies)):
        cell = framed(int(sight.cell[seat, unit]), side, is_turned)
        out.cell[seat, unit], out.alive[seat, unit] = cell, sight.alive[seat, unit]
        legal = out.legal[seat, unit]
        legal[:] = 0
        legal[_STAY] = 1
        if not sight.alive[seat, unit]:
            continue
        flies, row, column = rules.flies[unit], cell // side, cell % side
        planes[row, column, Plane.OWN_UAV if flies else Plane.OWN_UGV] += ONE
        if not flies:
            n_walkers += 1
            _strike(planes, Plane.OWN_STRENGTH, cell, rules.reach[unit], rules.strength[unit], side)
        for action in range(1, len(legal)):
            to_row, to_column = row_after(row, action), column_after(column, action)
            if is_on_board(to_row, to_column, side):
                there = framed(to_row * side + to_column, side, is_turned)
                legal[action] = can_enter(belief.ground[seat, there], flies)
    return n_walkers


@jit()
def _encode(sight: Sight, belief: Belief, rules: TeamRules, out: Encoded) -> None:
    side = rules.side
    for seat in range(len(sight.tick)):
        is_turned = belief.forward[seat] < 0
        _draw_ground(seat, belief, side, out.planes[seat], is_turned)
        _draw_tracks(seat, belief, side, out.planes[seat], is_turned)
        n_own, n_enemies = _draw_units(seat, sight, belief, rules, out, is_turned), belief.n_enemies[seat]
        scalars = out.scalars[seat]
        scalars[Scalar.TIME] = sight.tick[seat] / 100
        scalars[Scalar.TIME_LEFT] = (rules.tick_limit - sight.tick[seat]) / 100
        scalars[Scalar.OWN_WALKERS] = n_own / 4
        scalars[Scalar.ENEMY_WALKERS] = n_enemies / 4
        scalars[Scalar.LEAD] = (n_own - n_enemies) / 4
        scalars[Scalar.SCORE] = sight.score[seat] / 20
        scalars[Scalar.ENEMY_FLAG_FOUND] = belief.enemy_flag[seat] >= 0
        scalars[Scalar.OWN_FLAG_FOUND] = belief.own_flag[seat] >= 0
        scalars[Scalar.FLAG_CELLS] = 2 * belief.n_flag_cells[seat] / (side * side)
