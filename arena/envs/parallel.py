"""The game for PettingZoo: every unit an agent, or every team."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from arena.envs.episodes import RENDER_MODES, Episodes, SteppedError, read_orders
from arena.envs.spaces import laid_out, order_space, state_space, team_space, unit_space
from arena.envs.views import Shown, lay_out, unit_dict
from arena.errors import UnknownNameError
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team, Termination

AGENTS = ("units", "teams")
_ACTIONS = frozenset(map(int, Action))


def parallel_env(
    ruleset: Ruleset | str = "paper",
    agents: str = "units",
    reward: str = "score",
    render_mode: str | None = None,
    frame: str = "board",
    layout: str = "dict",
) -> "ParallelCapture":
    """Return the game as a PettingZoo `ParallelEnv`; the parameters are those of `ParallelCapture`."""
    return ParallelCapture(ruleset, agents, reward, render_mode, frame, layout)


class ParallelCapture(ParallelEnv, EzPickle):  # type: ignore[misc]
    """Capture the flag, both teams played by the caller.

    Parameters
    ----------
    agents
        `teams`: agents `blue` and `red`, an action for each unit. `units`: agents `blue_0`, `blue_1`, ..., an action each, and
        the team's reward for all of them; one that falls is terminated.
    ruleset, reward, frame, layout
        As `Episodes` has them.

    Notes
    -----
    The tick limit is a rule of the game, after which the score decides, and the tick is observed: a match that reaches it is
    terminated, never truncated. A copy, pickled or deep, is a new environment made with the same arguments.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "capture_the_flag_v0", "render_modes": list(RENDER_MODES), "render_fps": 10}

    def __init__(
        self, ruleset: Ruleset | str, agents: str, reward: str, render_mode: str | None, frame: str, layout: str
    ) -> None:
        EzPickle.__init__(self, ruleset, agents, reward, render_mode, frame, layout)
        if agents not in AGENTS:
            raise UnknownNameError("kind of agents", agents, AGENTS)
        self._episodes = Episodes(ruleset, reward, render_mode, frame, layout)
        self.render_mode, self._layout = render_mode, layout
        self.ruleset = self._episodes.ruleset
        self._n_units = self._episodes.game.n_units
        self._has_units = agents == "units"
        self._seats: dict[str, tuple[Team, int | None]] = {}
        for team in Team:
            name = team.name.lower()
            units = [(f"{name}_{unit}", unit) for unit in range(self._n_units[team])] if self._has_units else [(name, None)]
            self._seats |= {agent: (team, unit) for agent, unit in units}
        self.possible_agents, self.agents, self._has_begun = list(self._seats), list[str](), False
        self.observation_spaces = {agent: self._space(team) for agent, (team, _) in self._seats.items()}
        self.state_space = state_space(self.ruleset)
        self.action_spaces = {agent: self._actions(team) for agent, (team, _) in self._seats.items()}

    def _space(self, team: Team) -> spaces.Space[Any]:
        space = unit_space(self.ruleset, team) if self._has_units else team_space(self.ruleset, team)
        return laid_out(space, self._layout)

    def _actions(self, team: Team) -> spaces.Space[Any]:
        return spaces.Discrete(len(Action)) if self._has_units else order_space(self.ruleset, team)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return what an agent may observe."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return what an agent may do."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Shown], dict[str, dict[str, Any]]]:
        """Begin a match; `options["keys"]`, of `MatchKeys`, names one among all that there are."""
        self._episodes.begin(seed, options)
        self.agents, self._has_begun = [*self.possible_agents], True
        return self._observe(self.agents), {agent: self._episodes.info() for agent in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Shown], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Play one tick.

        Parameters
        ----------
        actions
            One action of each living agent: a number, or with `agents="teams"` one for each unit, fallen ones included. No
            actions at all after the end of a match change nothing.

        Raises
        ------
        SteppedError
            No match runs, or these are no actions of these agents.
        """
        if not actions and not self.agents and self._has_begun:  # the last call of wrappers that end a match a step later
            return {}, {}, {}, {}, {}
        self._episodes.check_running()
        reward = self._episodes.step(self._read(actions))
        before, is_over = self.agents, self._episodes.ending is not Termination.RUNNING
        observations, info = self._observe(before), self._episodes.info()
        fallen = {agent for agent in before if self._has_fallen(*self._seats[agent])}
        self.agents = [] if is_over else [agent for agent in before if agent not in fallen]
        return (
            observations,
            {agent: reward if self._seats[agent][0] is Team.BLUE else -reward for agent in before},
            {agent: agent not in self.agents for agent in before},
            dict.fromkeys(before, False),
            {agent: {**info} for agent in before},
        )

    def render(self) -> str | NDArray[np.uint8] | None:
        """Return the true board, as `render_mode` has it."""
        return self._episodes.render()

    def close(self) -> None:
        """Nothing is held."""

    def state(self) -> NDArray[np.int8]:
        """Return the true board; int8, shape (side, side), codes of the paper's Table 2. For critics, never for those who act."""
        return self._episodes.game.truth(0)

    def _observe(self, agents: list[str]) -> dict[str, Shown]:
        known, shown = {team: self._episodes.observe(team) for team in Team}, {}
        for agent in agents:
            team, unit = self._seats[agent]
            shown[agent] = lay_out(known[team] if unit is None else unit_dict(known[team], unit), self._layout)
        return shown

    def _has_fallen(self, team: Team, unit: int | None) -> bool:
        return unit is not None and not self._episodes.seen[team].alive[0, unit]

    def _read(self, actions: Mapping[str, Any]) -> dict[Team, NDArray[np.int8]]:
        if set(actions) != set(self.agents):
            raise SteppedError(f"there must be actions of {', '.join(self.agents)}, not of {', '.join(actions) or 'nobody'}")
        orders = {team: np.zeros(self._n_units[team], np.int8) for team in Team}
        for agent, answer in actions.items():
            team, unit = self._seats[agent]
            if unit is None:
                orders[team] = read_orders(answer, orders[team].shape, agent)
            elif isinstance(answer, int | np.integer) and answer in _ACTIONS and not isinstance(answer, bool):
                orders[team][unit] = answer
            else:
                orders[team][unit] = read_orders([answer], (1,), agent)[0]
        return {team: self._episodes.to_orders(team, own) for team, own in orders.items()}
