"""The rules as a thing to hold: a batch of games that is started, stepped and observed.

The local venue, the networked referee, the environments and the replay all play through this class, so that there is one
`step` and one `observe`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from arena.errors import BoardError
from arena.game.board import Board, parse_board
from arena.game.draw import MAX_ATTEMPTS, begin
from arena.game.kernel import draw_boards, observe, play, sense, step
from arena.game.keys import KEY_BYTES, MatchKeys, philox_keys
from arena.game.observation import Observations, make_seen
from arena.game.ruleset import Ruleset
from arena.game.state import State, StateField, Tables, TickEvents, Trait, make_state, make_tables
from arena.game.types import FLAGS, UAVS, UGVS, Team, Termination
from arena.jit import bind

WORK_SHAPE = (4, 32)
_ALL = slice(None)
_ENDING, _N_DIGESTED = int(StateField.ENDING), int(StateField.SCORE) + 1
_RUNNING = int(Termination.RUNNING)
"""As `_ENDING` a plain number: numpy takes microseconds over a member of an enumeration."""


def warm(ruleset: Ruleset) -> None:
    """Compile, or load, all that a match needs, before anybody waits for it."""
    for prepare in (prepare_boards, prepare_views, prepare_steps, prepare_turns):
        prepare(ruleset)


def prepare_boards(ruleset: Ruleset) -> None:
    """Compile, or load, what lays out a match."""
    BatchedGame(ruleset, 1).start([0], [MatchKeys(map_key=bytes(KEY_BYTES), match_key=bytes(KEY_BYTES))])


def prepare_views(ruleset: Ruleset) -> None:
    """Compile, or load, what each team is shown."""
    games = BatchedGame(ruleset, 1)
    games.observe()
    games.grids()


def prepare_steps(ruleset: Ruleset) -> None:
    """Compile, or load, a step of a match."""
    games = BatchedGame(ruleset, 1)
    games.step(np.zeros(games.state.cell.shape, np.int8))


def prepare_turns(ruleset: Ruleset) -> None:
    """Compile, or load, a step and what is shown after it, in one: a turn in a pit."""
    games = BatchedGame(ruleset, 1)
    games.play(np.zeros(games.state.cell.shape, np.int8))


@lru_cache(maxsize=64)
def tables_of(ruleset: Ruleset) -> Tables:
    """Return the tables of a ruleset, made once."""
    return make_tables(ruleset)


class BatchedGame:
    """A batch of games under one ruleset; row i of every array is game i. A row is empty until `start`."""

    def __init__(self, ruleset: Ruleset, n_games: int) -> None:
        self.ruleset = ruleset
        self.n_games = n_games
        self.state: State = make_state(ruleset, n_games)
        self.state.field[:, StateField.ENDING] = Termination.TICK_LIMIT
        self.tables = tables_of(ruleset)
        self.n_units = {team: len(ruleset.team(team)) for team in Team}
        self._board = parse_board(ruleset.board) if ruleset.board is not None else None
        self._orders = np.zeros(self.state.cell.shape, np.int8)
        self._work = np.zeros(WORK_SHAPE, np.int64)
        self._rows = np.zeros((2, ruleset.side + 2), np.uint64)
        self._boards = np.zeros((2, n_games, self.state.ground.shape[1]), np.int8)
        self._seat_keys = np.zeros((2, n_games, 2), np.uint32)
        self._told = [make_seen(ruleset, team, n_games) for team in Team]
        self._seen = {team: self._make_observations(team) for team in Team}
        self._unfogged: BatchedGame | None = None

    def start(self, games: Sequence[int] | NDArray[np.intp], keys: Sequence[MatchKeys]) -> None:
        """Lay out new games in some rows.

        Raises
        ------
        BoardError
            No board could be drawn on which every walking unit reaches the enemy flag.
        """
        rows = np.asarray(games, np.int64)
        drawn = philox_keys(keys)
        self.state.key[rows] = drawn.unit
        self._seat_keys[:, rows] = drawn.seat.swapaxes(0, 1)
        if self._board is not None:
            for row in rows:
                lay_out(self.state, self.tables, int(row), self._board, self.ruleset)
            return
        if draw_boards(self.state, self.tables, rows, drawn.board.copy(), self._rows) >= 0:
            raise BoardError(
                f"ruleset {self.ruleset.name}: none of {MAX_ATTEMPTS} boards had room for every unit and a way to the flag for "
                "each; use a larger side, fewer units or no obstacles"
            )

    def step(self, orders: NDArray[np.int8]) -> None:
        """Play one tick of every running game.

        Parameters
        ----------
        orders
            int8, shape (n_games, units), blue's units first; any number that is no `Action` means to stay.
        """
        if orders.shape != self.state.cell.shape or orders.dtype != np.int8:
            raise ValueError(f"orders must be int8 of shape {self.state.cell.shape}, not {orders.dtype} of {orders.shape}")
        self._orders[:] = orders
        self._step()

    @property
    def events(self) -> TickEvents:
        """What the last tick of each game did, in fresh memory; nothing before a game's first."""
        return TickEvents(*np.moveaxis(self.state.event == self.state.field[:, None, None, StateField.TICK], 1, 0))

    def play(self, orders: NDArray[np.int8]) -> dict[Team, Observations]:
        """Step and observe, in one call."""
        self._orders[:] = orders
        self._play()
        return self._seen

    @cached_property
    def _step(self) -> Callable[[], None]:
        return bind(step, self.state, self._orders, self.tables, self._work, True)

    @cached_property
    def _sense(self) -> Callable[[], None]:
        return bind(sense, self.state, self.tables, self._seat_keys, self._boards, self._rows, *self._told)

    @cached_property
    def _play(self) -> Callable[[], None]:
        scratch = self._work, self._seat_keys, self._boards, self._rows
        return bind(play, self.state, self._orders, self.tables, *scratch, *self._told)

    def observe(self) -> dict[Team, Observations]:
        """Return what each team sees now, in memory that the next call overwrites; no clock runs, unless the caller sets it."""
        self._sense()
        return self._seen

    def observe_without_fog(self) -> dict[Team, Observations]:
        """Return what each team would see without the fog, in memory of its own: for the local venue's cheats."""
        if self._unfogged is None:
            unfogged = BatchedGame(replace(self.ruleset, fog=False), self.n_games)
            unfogged.state, unfogged._seat_keys = self.state, self._seat_keys
            unfogged._seen = {team: unfogged._make_observations(team) for team in Team}
            self._unfogged = unfogged
        return self._unfogged.observe()

    def grids(self) -> NDArray[np.int8]:
        """Return both teams' Table 2 boards; int8, shape (2 teams, n_games, side, side), freshly made."""
        boards = np.zeros_like(self._boards)
        observe(self.state, self.tables, boards, self._rows, True, True)
        side = self.ruleset.side
        return boards[:, :, : side * side].reshape(2, self.n_games, side, side)

    def truth(self, game: int) -> NDArray[np.int8]:
        """Return one game's true board in the codes of Table 2, for those who may see it; int8, shape (side, side)."""
        side = self.ruleset.side
        board = self.state.ground[game, : side * side].copy()
        first_red = self.n_units[Team.BLUE]
        for flies, codes in ((1, UAVS), (0, UGVS)):
            for unit, cell in reversed(list(enumerate(self.state.cell[game].tolist()))):
                if self.state.alive[game, unit] and self.tables.unit[unit, Trait.FLIES] == flies:
                    board[cell] = codes[unit >= first_red]
        return board.reshape(side, side)

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """Which rows hold no running game; shape (n_games,)."""
        over: NDArray[np.bool_] = self.state.field[:, _ENDING] != _RUNNING
        return over

    def has_ended(self, game: int) -> bool:
        """Whether one row holds no running game."""
        return bool(self.state.field[game, _ENDING])

    def digestible_views(self, game: int) -> list[memoryview]:
        """Return views of the memory that one row of `digestible` comes from: joined, they are its bytes at any time."""
        parts = self.state.field[game, :_N_DIGESTED], self.state.cell[game], self.state.alive[game]
        return [part.view(np.uint8).data for part in parts]

    def digestible(self, games: slice | Sequence[int] = _ALL) -> NDArray[np.uint8]:
        """Return the bytes of each true state that change from tick to tick; shape (n_games, bytes), freshly made."""
        facts = np.ascontiguousarray(self.state.field[games, :_N_DIGESTED], "<i4").view(np.uint8)
        cells = self.state.cell[games].astype("<i2", copy=False).view(np.uint8)
        return np.concatenate([facts, cells, self.state.alive[games]], axis=1)

    def _make_observations(self, team: Team) -> Observations:
        first = self.n_units[Team.BLUE] if team is Team.RED else 0
        own = slice(first, first + self.n_units[team])
        return Observations.blank(
            self.ruleset,
            team,
            self.n_games,
            ground=self._boards[team],
            cell=self.state.cell[:, own],
            alive=self.state.alive[:, own],
            **self._told[team]._asdict(),
        )


def lay_out(state: State, tables: Tables, game: int, board: Board, ruleset: Ruleset) -> None:
    """Set one game to the start of a given board, whose units are those of the ruleset."""
    side = board.side
    state.ground[game, : side * side] = board.ground.ravel()
    unit = 0
    for team in Team:
        state.field[game, StateField.BLUE_FLAG + team] = int(np.flatnonzero(board.ground == FLAGS[team])[0])
        for row, column in (*board.walkers[team], *board.flyers[team]):
            state.cell[game, unit] = row * side + column
            unit += 1
    begin(game, state, tables)
