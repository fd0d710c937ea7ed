"""The game for Gymnasium's vector interface: many matches in one batch of the kernel, for speed."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from arena.envs.episodes import FULL_SCORE, SteppedError, check_reward, keys_of, load_rules, read_orders
from arena.envs.single import read_team
from arena.envs.spaces import ObservationDict, order_space, team_dict, team_space
from arena.game.engine import BatchedGame
from arena.game.keys import new_secret, secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Team
from arena.policy import BatchFactory


class VectorCapture(VectorEnv[ObservationDict, NDArray[Any], NDArray[Any]]):
    """Capture the flag against a fighter, `num_envs` matches at once; the other parameters are those of `SingleCapture`.

    A match that has ended begins anew at the next step, whose actions are passed over for it (`AutoresetMode.NEXT_STEP`).
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # as the base class declares it

    def __init__(
        self,
        num_envs: int,
        opponent: BatchFactory,
        team: str = "blue",
        ruleset: Ruleset | str = "paper",
        reward: str = "score",
    ) -> None:
        check_reward(reward)
        self.num_envs, self._team, self._is_outcome = num_envs, read_team(team), reward == "outcome"
        self.ruleset = load_rules(ruleset)
        self._games = BatchedGame(self.ruleset, num_envs)
        self._opponent = opponent(self.ruleset, self._team.other, num_envs)
        self.single_observation_space = team_space(self.ruleset, self._team)
        self.single_action_space = order_space(self.ruleset, self._team)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._secrets = [new_secret() for _ in range(num_envs)]
        self._n_begun = np.zeros(num_envs, np.int64)
        self._has_begun = False

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[ObservationDict, dict[str, Any]]:
        """Begin a match in every row. With one seed, row i plays as `SingleCapture` does under `seed + i`."""
        super().reset(seed=seed if isinstance(seed, int) else None)
        seeds = [seed + row for row in range(self.num_envs)] if isinstance(seed, int) else seed or [None] * self.num_envs
        for row, one in enumerate(seeds):
            if one is not None:
                self._secrets[row], self._n_begun[row] = secret_from_seed(one), 0
        self._begin(np.arange(self.num_envs))
        self._has_begun = True
        return team_dict(self._games, self._team), {}

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[ObservationDict, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play one tick everywhere; `actions` has shape (num_envs, units)."""
        if not self._has_begun:
            raise SteppedError("no match was begun; call reset() first")
        n_units = self._games.n_units
        own = read_orders(actions, (self.num_envs, n_units[self._team]), self._team.name.lower())
        anew = np.flatnonzero(self._games.is_over)
        before = self._score()
        theirs = np.zeros((self.num_envs, n_units[self._team.other]), np.int8)
        self._opponent.act(self._games.observe()[self._team.other], theirs)
        self._games.step(np.concatenate([own, theirs] if self._team is Team.BLUE else [theirs, own], axis=1))
        is_over, after = self._games.is_over, self._score()
        rewards = np.sign(after) * is_over if self._is_outcome else (after - before) / FULL_SCORE
        rewards[anew], is_over[anew] = 0.0, False
        self._begin(anew)
        return team_dict(self._games, self._team), rewards, is_over, np.zeros(self.num_envs, np.bool_), {}

    def _score(self) -> NDArray[np.float64]:
        """Return the own scores, shape (num_envs,)."""
        blue = self._games.state.field[:, StateField.SCORE].astype(np.float64)
        return blue if self._team is Team.BLUE else -blue

    def _begin(self, rows: NDArray[np.intp]) -> None:
        if not len(rows):
            return
        self._games.start(rows, [keys_of(self._secrets[row], int(self._n_begun[row])) for row in rows])
        self._opponent.start(rows)
        self._n_begun[rows] += 1
