"""What a team knows, as data: its own units, the cells in its sight, and the public facts.

`Observation` is what one seat is told at one tick, and what a bot's `act` receives. `Observations` is the same for a
batch of seats of one team, as arrays, for policies that think about a thousand matches at once.
"""

from collections import namedtuple
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from arena.annotations import NO_PEN, Annotations, Pen
from arena.game import observation_fields as of
from arena.game.observation_fields import FieldSpec
from arena.game.rules import can_enter, column_after, is_home, is_on_board, row_after
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, UAVS, UGVS, Action, Code, Team

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
    annotations: Annotations | None = field(default=None, repr=False)
    """Where `log` and `draw` write; None where nobody keeps it."""

    @classmethod
    def from_board(
        cls,
        text: str,
        *,
        tick: int = 0,
        team: Team = Team.BLUE,
        rules: str | Ruleset = "paper",
        fallen: Iterable[tuple[int, int]] = (),
        score: int | None = None,
        seed: int = 0,
        clock_s: float | None = None,
        fog: bool | None = None,
    ) -> "Observation":
        """Return what a team is shown on a drawn board: exactly what the game would show it, to try a bot on.

        Parameters
        ----------
        text
            Letters, one a cell: `F U A` blue's flag, UGVs and UAVs, `f u a` red's, `#` an obstacle, `.` land; blue's half is the
            left one. Indentation and empty lines mean nothing. The board sets the side and the number of units.
        rules
            A shipped ruleset by name, a TOML file, or a ruleset; all but the board is taken from it.
        fallen
            (row, column) of drawn units, of either team, that have fallen there.
        score
            The team's own; without it, the one that follows from who has fallen.
        seed
            What `Observation.seed` is to be, below 2**64.
        clock_s
            What `Observation.clock_s` is to be.
        fog
            False shows the whole board; without it, the rules say.

        Raises
        ------
        BoardError
            The board cannot be played on.
        ValueError
            No match is running at this tick, or nobody is drawn where a unit is to have fallen.

        Examples
        --------
        >>> seen = Observation.from_board(
        ...     '''
        ...     F..f
        ...     .U.u
        ...     ....
        ...     ....
        ...     ''',
        ...     tick=12,
        ...     team=Team.RED,
        ... )
        >>> [(unit.type, unit.row, unit.column) for unit in seen.enemies]
        [('ugv', 1, 1)]
        """
        from arena.game.drawn_board import observe_board  # plays with the engine, which is made of this module

        return observe_board(text, tick, team, rules, frozenset(fallen), score, seed, clock_s, fog)

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

    def log(self, *values: object) -> None:
        """Note a line of text for the bot's author, made of `values` as `print` would; see `arena.annotations`."""
        if self.annotations is not None:
            self.annotations.log(*values)

    @property
    def draw(self) -> Pen:
        """What draws over the board for the bot's author: `cell`, `path`, `heat`."""
        return NO_PEN if self.annotations is None else self.annotations.draw

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
    seed: Annotated[NDArray[np.uint64], FieldSpec(is_of_kernel=True)]
    """Shape (n,)."""
    tick: Annotated[NDArray[np.int32], FieldSpec(values=of.ticks, is_of_kernel=True, is_public=True)]
    """Shape (n,)."""
    clock_ms: Annotated[NDArray[np.uint32], FieldSpec(blank=NO_CLOCK_MS)]
    """Shape (n,): the extra time that the seat has left, or `NO_CLOCK_MS`."""
    score: Annotated[NDArray[np.int16], FieldSpec(values=range(-100, 101), is_of_kernel=True, is_public=True)]
    """Shape (n,): the own score."""
    living: Annotated[NDArray[np.int16], FieldSpec(axes=(2,), values=of.counts, is_of_kernel=True, is_public=True)]
    """Shape (n, 2): own, enemy."""
    cell: Annotated[NDArray[np.int16], FieldSpec(axes=(of.n_own,), values=of.cells)]
    """Shape (n, own units): row * side + column of each own unit."""
    enemy_cell: Annotated[
        NDArray[np.int16], FieldSpec(axes=(of.n_enemies,), values=of.cells_or_none, blank=-1, is_of_kernel=True)
    ]
    """Shape (n, enemy units): those in sight by cell and type, then -1."""
    enemy_type: Annotated[NDArray[np.int8], FieldSpec(axes=(of.n_enemies,), values=of.types_or_none, blank=-1, is_of_kernel=True)]
    """Shape (n, enemy units): index into `Ruleset.units`, beside `enemy_cell`; -1 after the last."""
    alive: Annotated[NDArray[np.uint8], FieldSpec(axes=(of.n_own,), values=range(2))]
    """Shape (n, own units)."""
    ground: Annotated[NDArray[np.int8], FieldSpec(axes=(of.n_cells,), values=of.GROUND_CODES, blank=Code.HIDDEN)]
    """Shape (n, stride): the cells of `Observation.ground` row by row; past side * side it means nothing."""
    enemy_flies: Annotated[
        NDArray[np.uint8], FieldSpec(axes=(of.n_enemies,), values=range(2), is_on_wire=False, is_of_kernel=True)
    ]
    """Shape (n, enemy units): beside `enemy_cell`; follows from `enemy_type`."""

    @classmethod
    def blank(cls, ruleset: Ruleset, team: Team, n_seats: int, **arrays: NDArray[Any]) -> "Observations":
        """Return observations made of `arrays`, and of fresh memory for the fields that are not among them."""
        rest = {name: _blank(name, ruleset, team, n_seats) for name in FIELDS if name not in arrays}
        return cls(team=team, side=ruleset.side, **arrays, **rest)

    def __len__(self) -> int:
        return len(self.tick)

    def select(self, seats: Any) -> "Observations":
        """Return the observations of some seats: a slice shares memory, an index array copies."""
        return Observations(team=self.team, side=self.side, **{name: getattr(self, name)[seats] for name in FIELDS})

    def seat(self, seat: int, ruleset: Ruleset, annotations: Annotations | None = None) -> Observation:
        """Return a copy of one seat's observation as a bot gets it; what it notes goes to `annotations`."""
        side, clock_ms = self.side, self.clock_ms.item(seat)
        ground = self.ground[seat, : side * side].reshape(side, side).copy()
        ground.flags.writeable = False
        own = zip(ruleset.team(self.team), self.cell[seat].tolist(), self.alive[seat].tolist(), strict=True)
        enemies = zip(self.enemy_cell[seat].tolist(), self.enemy_type[seat].tolist(), strict=True)
        return Observation(
            team=self.team,
            ground=ground,
            units=tuple(
                [
                    OwnUnit(
                        index=index, type=kind.name, row=cell // side, column=cell % side, alive=bool(alive), flies=kind.flies
                    )
                    for index, (kind, cell, alive) in enumerate(own)
                ]
            ),
            enemies=tuple(
                [
                    EnemyUnit(
                        row=cell // side, column=cell % side, type=ruleset.units[kind].name, flies=ruleset.units[kind].flies
                    )
                    for cell, kind in enemies
                    if cell >= 0
                ]
            ),
            clock_s=None if clock_ms == NO_CLOCK_MS else clock_ms / 1000,
            annotations=annotations,
            **{name: _plain(getattr(self, name), seat) for name in _NUMBERS},
        )


def _plain(array: NDArray[Any], seat: int) -> Any:
    """Return what one seat has of a field, as a Python number or a tuple of them."""
    return array.item(seat) if array.ndim == 1 else tuple(array[seat].tolist())


def _read_specs() -> dict[str, FieldSpec]:
    hints = get_type_hints(Observations, include_extras=True)
    rows: dict[str, Any] = {name: get_args(hint) for name, hint in hints.items() if hasattr(hint, "__metadata__")}
    return {name: replace(spec, dtype=get_args(get_args(array)[1])[0]) for name, (array, spec) in rows.items()}


FIELDS = _read_specs()
"""The table: what is laid out how, by name, in the order of the wire."""
_NUMBERS = [one.name for one in fields(Observation) if one.name in FIELDS and one.name != "ground"]
"""Fields that `Observation` has under the same name, as a number or a tuple of them."""
_OF_KERNEL = [name for name, spec in FIELDS.items() if spec.is_of_kernel]
_KernelFields: Any = namedtuple("_KernelFields", _OF_KERNEL)  # type: ignore[misc]  # mypy wants the names spelled out
if TYPE_CHECKING:
    Seen = Observations
else:
    Seen = _KernelFields
"""The fields that the kernel writes, as arrays; typed as what it shares them with, so that none is spelled out again."""


def make_seen(ruleset: Ruleset, team: Team, n_games: int) -> Any:
    """Return memory for what the kernel writes, nobody in sight."""
    return _KernelFields(*(_blank(name, ruleset, team, n_games) for name in _OF_KERNEL))


def _blank(name: str, ruleset: Ruleset, team: Team, n_seats: int) -> NDArray[Any]:
    spec = FIELDS[name]
    return np.full((n_seats, *spec.shape_of(ruleset, team)), spec.blank, spec.dtype)


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
