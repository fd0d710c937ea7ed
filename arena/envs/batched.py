"""The game for training: a batch of rows that never stops, since a row whose match has ended begins the next one at once.

It is `arena.game.engine.BatchedGame` with keys: there is no second `step` and no second `observe`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Team


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepResult:
    """What one tick led to, in every row, before any row began anew."""

    score: NDArray[np.int32]
    """Shape (n_games,): blue's score after the tick."""
    has_ended: NDArray[np.bool_]
    """Shape (n_games,)."""
    winner: NDArray[np.int32]
    """Shape (n_games,): a `Team`, or -1; means nothing where the match goes on."""
    ending: NDArray[np.int32]
    """Shape (n_games,): an `Termination`."""
    ticks: NDArray[np.int32]
    """Shape (n_games,): ticks played so far."""


class BatchedEnv:
    """A batch of games that goes on for ever.

    Parameters
    ----------
    seed
        Of the maps and of all chance. The match of a row depends on the seed, the row and how many came before it there,
        never on the size of the batch.
    first_row
        Number of the first row: processes that share a seed and take different rows never play one match twice.
    """

    def __init__(self, ruleset: Ruleset, n_games: int, *, seed: int, first_row: int = 0) -> None:
        self.ruleset, self.n_games = ruleset, n_games
        self.games = BatchedGame(ruleset, n_games)
        self.episode = np.zeros(n_games, np.int64)
        """Shape (n_games,): matches begun in each row."""
        self._first_row = first_row
        self._secret = secret_from_seed(seed)
        self._orders = np.zeros(self.games.state.cell.shape, np.int8)
        self._n_blue = self.games.n_units[Team.BLUE]
        self._begin(np.arange(n_games))

    def observe(self) -> dict[Team, Observations]:
        """Return what each team sees, in memory that the next call overwrites."""
        return self.games.observe()

    def step(self, orders: dict[Team, NDArray[np.int8]]) -> StepResult:
        """Play one tick, and begin anew where a match ended.

        Parameters
        ----------
        orders
            For each team int8, shape (n_games, units).
        """
        self._orders[:, : self._n_blue] = orders[Team.BLUE]
        self._orders[:, self._n_blue :] = orders[Team.RED]
        self.games.step(self._orders)
        field = self.games.state.field
        turn = StepResult(
            score=field[:, StateField.SCORE].copy(),
            has_ended=self.games.is_over,
            winner=field[:, StateField.WINNER].copy(),
            ending=field[:, StateField.ENDING].copy(),
            ticks=field[:, StateField.TICK].copy(),
        )
        self._begin(np.flatnonzero(turn.has_ended))
        return turn

    def skip_to(self, episode: NDArray[np.int64]) -> None:
        """Begin anew in every row, after as many matches as `episode` says."""
        self.episode[:] = episode
        self._begin(np.arange(self.n_games))

    def _begin(self, rows: NDArray[np.intp]) -> None:
        keys = []
        for row in rows.tolist():
            name, episode = f"train/{self._first_row + row}", int(self.episode[row])
            map_key = derive_map_key(self._secret, name, episode)
            keys.append(MatchKeys(map_key=map_key, match_key=derive_match_key(self._secret, f"{name}/{episode}")))
            self.episode[row] += 1
        if keys:
            self.games.start(rows, keys)
