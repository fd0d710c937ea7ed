"""The game for Gymnasium: one team played by the caller, the other by a fighter."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from arena.envs.episodes import RENDER_MODES, Episodes, abandoned, read_orders
from arena.envs.spaces import laid_out, order_space, team_space
from arena.envs.views import Shown, lay_out
from arena.errors import UnknownNameError
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import BatchFactory
from arena.records.replay import match_results

TEAMS = tuple(team.name.lower() for team in Team)


class SingleCapture(gymnasium.Env[Shown, NDArray[Any]], EzPickle):
    """Capture the flag against a fighter.

    Parameters
    ----------
    opponent
        Makes the fighter on the other side, as a `BatchPolicy` does; `policies.environments` finds it by name.
    team
        The side of the caller.
    ruleset, reward, frame, layout
        As `Episodes` has them.

    Notes
    -----
    The tick limit is a rule of the game, after which the score decides, and the tick is observed: a match that reaches it is
    terminated, never truncated. A copy, pickled or deep, is a new environment made with the same arguments.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # noqa: RUF012  # as the base class declares it

    def __init__(
        self,
        opponent: BatchFactory,
        team: str = "blue",
        ruleset: Ruleset | str = "paper",
        reward: str = "score",
        render_mode: str | None = None,
        frame: str = "board",
        layout: str = "dict",
    ) -> None:
        EzPickle.__init__(self, opponent, team, ruleset, reward, render_mode, frame, layout)
        self._team = read_team(team)
        self._episodes = Episodes(ruleset, reward, render_mode, frame, layout)
        self.render_mode, self._layout = render_mode, layout
        self.ruleset = rules = self._episodes.ruleset
        self._n_units = self._episodes.game.n_units
        self._opponent = opponent(rules, self._team.other, 1)
        self.observation_space: spaces.Space[Any] = laid_out(team_space(rules, self._team), layout)
        self.action_space = order_space(rules, self._team)

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Shown, dict[str, Any]]:
        """Begin a match; `options["keys"]`, of `MatchKeys`, names one among all that there are."""
        super().reset(seed=seed)
        if self._episodes.ending is Termination.RUNNING:
            self._opponent.end(0, abandoned(int(self._episodes.seen[self._team].tick[0])))
        self._episodes.begin(seed, options)
        self._opponent.start(np.zeros(1, np.intp))
        return self._observe(), self._episodes.info()

    def step(self, actions: NDArray[Any]) -> tuple[Shown, float, bool, bool, dict[str, Any]]:
        """Play one tick; `SteppedError` if no match runs, or these are not an action for each unit."""
        self._episodes.check_running()
        own = read_orders(actions, (self._n_units[self._team],), self._team.name.lower())
        theirs = np.zeros((1, self._n_units[self._team.other]), np.int8)
        self._opponent.act(self._episodes.seen[self._team.other], theirs)
        orders = {self._team: self._episodes.to_orders(self._team, own), self._team.other: theirs[0]}
        reward = self._episodes.step(orders)
        is_over = self._episodes.ending is not Termination.RUNNING
        if is_over:
            [result] = match_results(self._episodes.game, [0])
            self._opponent.end(0, result.seen_by(self._team.other))
        own_reward = reward if self._team is Team.BLUE else -reward
        return self._observe(), own_reward, is_over, False, self._episodes.info()

    def render(self) -> Any:
        """Return the true board, as `render_mode` has it."""
        return self._episodes.render()

    def _observe(self) -> Shown:
        return lay_out(self._episodes.observe(self._team), self._layout)


def read_team(name: str) -> Team:
    """Return a team by its name."""
    if name not in TEAMS:
        raise UnknownNameError("team", name, TEAMS)
    return Team[name.upper()]
