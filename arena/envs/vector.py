"""The game for Gymnasium's vector interface: many matches in one batch of the kernel, for speed."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.utils import EzPickle
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from arena.envs.episodes import FULL_SCORE, SteppedError, abandoned, check_reward, keys_of, read_orders
from arena.envs.single import read_team
from arena.envs.spaces import laid_out, order_space, team_space
from arena.envs.views import Shown, TeamView, check_layout, lay_out, load_rules
from arena.errors import InputError, UnknownNameError
from arena.game.engine import BatchedGame
from arena.game.keys import new_secret, secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Team
from arena.policy import BatchFactory
from arena.records.replay import match_results


class VectorCapture(VectorEnv[Shown, NDArray[Any], NDArray[Any]], EzPickle):
    """Capture the flag against a fighter, `num_envs` matches at once; the other parameters are those of `SingleCapture`.

    Parameters
    ----------
    autoreset_mode
        When a match that has ended is followed by the next one, as Gymnasium's `AutoresetMode` or its value. `NEXT_STEP`: at the
        next step, whose actions are passed over for it. `SAME_STEP`: at once; the last observation and info of the match stand in
        the info, as `final_obs` and `final_info`. `DISABLED`: when `reset` is called with a `reset_mask`.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # as the base class declares it

    def __init__(
        self,
        num_envs: int,
        opponent: BatchFactory,
        team: str = "blue",
        ruleset: Ruleset | str = "paper",
        reward: str = "score",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        frame: str = "board",
        layout: str = "dict",
    ) -> None:
        EzPickle.__init__(self, num_envs, opponent, team, ruleset, reward, autoreset_mode, frame, layout)
        if num_envs < 1:
            raise InputError(f"num_envs is {num_envs}; there must be at least one row")
        check_reward(reward)
        check_layout(layout)
        self.num_envs, self._team, self._is_outcome = num_envs, read_team(team), reward == "outcome"
        self.ruleset = load_rules(ruleset)
        self.autoreset_mode = _read_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self._view, self._layout = TeamView(self.ruleset, self._team, frame), layout
        self._games = BatchedGame(self.ruleset, num_envs)
        self._seen = self._games.observe()
        self._opponent = opponent(self.ruleset, self._team.other, num_envs)
        self.single_observation_space = laid_out(team_space(self.ruleset, self._team), layout)
        self.single_action_space = order_space(self.ruleset, self._team)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._secrets = [new_secret() for _ in range(num_envs)]
        self._n_begun = np.zeros(num_envs, np.int64)
        self._has_begun = False

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Shown, dict[str, Any]]:
        """Begin a match in every row, or in those of `options["reset_mask"]`.

        Parameters
        ----------
        seed
            With one seed, row i plays as `SingleCapture` does under `seed + i`; a list has one for each row.
        options
            `reset_mask`: bool, shape (num_envs,), at least one of them true. The other rows go on as they are.

        Raises
        ------
        SteppedError
            The mask or the seeds do not fit the rows.
        """
        mask, seeds = self._read_mask(options), self._read_seeds(seed)
        super().reset(seed=seed if isinstance(seed, int) else None)
        for row in np.flatnonzero(mask).tolist():
            one = seeds[row]
            if one is not None:
                self._secrets[row], self._n_begun[row] = secret_from_seed(one), 0
        self._begin(np.flatnonzero(mask))
        self._has_begun = True
        return self._observe(), self._info(mask)

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Shown, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play one tick everywhere; `actions` has shape (num_envs, units)."""
        if not self._has_begun:
            raise SteppedError("no match was begun; call reset() first")
        n_units = self._games.n_units
        own = self._view.to_orders(read_orders(actions, (self.num_envs, n_units[self._team]), self._team.name.lower()))
        were_over = self._games.is_over
        if self.autoreset_mode is AutoresetMode.DISABLED and were_over.any():
            raise SteppedError(f"the matches of rows {np.flatnonzero(were_over).tolist()} are over; reset them by a reset_mask")
        before = self._score()
        theirs = np.zeros((self.num_envs, n_units[self._team.other]), np.int8)
        self._opponent.act(self._seen[self._team.other], theirs)
        self._games.step(np.concatenate([own, theirs] if self._team is Team.BLUE else [theirs, own], axis=1))
        is_over, after = self._games.is_over, self._score()
        rewards = np.sign(after) * is_over if self._is_outcome else (after - before) / FULL_SCORE
        rewards[were_over], is_over[were_over] = 0.0, False
        ended = np.flatnonzero(is_over).tolist()
        for row, result in zip(ended, match_results(self._games, ended), strict=True):
            self._opponent.end(row, result.seen_by(self._team.other))
        final: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            final = self._final(is_over)
            self._begin(np.flatnonzero(is_over))
        else:
            self._begin(np.flatnonzero(were_over))
        infos = final | self._info(np.ones(self.num_envs, np.bool_))
        return self._observe(), rewards, is_over, np.zeros(self.num_envs, np.bool_), infos

    def _observe(self) -> Shown:
        return lay_out(self._view.read(self._games.observe()[self._team]), self._layout)

    def _info(self, rows: NDArray[np.bool_]) -> dict[str, Any]:
        """Return how the matches of some rows stand, as Gymnasium batches infos."""
        return {"ending": self._games.state.field[:, StateField.ENDING] * rows.astype(np.int64), "_ending": rows.copy()}

    def _final(self, is_over: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the last observations and infos of matches that have ended, as Gymnasium batches them; nothing if none has."""
        if not is_over.any():
            return {}
        rows = np.flatnonzero(is_over)
        seen, last = self._view.read(self._games.observe()[self._team].select(rows)), np.full(self.num_envs, None, object)
        for number, row in enumerate(rows):
            last[row] = lay_out({name: values[number].copy() for name, values in seen.items()}, self._layout)
        return {"final_obs": last, "_final_obs": is_over.copy(), "final_info": self._info(is_over), "_final_info": is_over.copy()}

    def _read_seeds(self, seed: int | list[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int):
            return [seed + row for row in range(self.num_envs)]
        if not isinstance(seed, list):
            raise SteppedError(f"seed must be an int, or a list with one for each of {self.num_envs} rows, not {seed!r}")
        if len(seed) != self.num_envs:
            raise SteppedError(f"there must be a seed for each of {self.num_envs} rows, not {len(seed)} of them")
        return seed

    def _read_mask(self, options: Mapping[str, Any] | None) -> NDArray[np.bool_]:
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
            raise SteppedError(f"reset_mask must be an array of {self.num_envs} truth values, one of them true, not {mask!r}")
        if not self._has_begun and not mask.all():
            raise SteppedError("no match was begun; call reset() without a reset_mask first")
        return mask

    def _score(self) -> NDArray[np.float64]:
        """Return the own scores, shape (num_envs,)."""
        blue = self._games.state.field[:, StateField.SCORE].astype(np.float64)
        return blue if self._team is Team.BLUE else -blue

    def _begin(self, rows: NDArray[np.intp]) -> None:
        if not len(rows):
            return
        for row in rows[~self._games.is_over[rows]].tolist():
            self._opponent.end(row, abandoned(int(self._games.state.field[row, StateField.TICK])))
        self._games.start(rows, [keys_of(self._secrets[row], int(self._n_begun[row])) for row in rows])
        self._opponent.start(rows)
        self._n_begun[rows] += 1


def _read_mode(mode: AutoresetMode | str) -> AutoresetMode:
    modes = {str(one.value): one for one in AutoresetMode}
    name = str(mode.value if isinstance(mode, AutoresetMode) else mode)
    if name not in modes:
        raise UnknownNameError("autoreset mode", name, list(modes))
    return modes[name]
