"""Matches one after another, each with keys of its own: what the environments for one match at a time have in common."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.envs.render import draw_letters, paint, show
from arena.envs.views import ObservationDict, TeamView, check_layout, load_rules
from arena.errors import InputError, UnknownNameError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, new_secret, secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Action, Team, Termination
from arena.policy import MatchResult

_LAST = int(max(Action))
REWARDS = ("score", "outcome")
RENDER_MODES = ("human", "ansi", "rgb_array")
FULL_SCORE = 100.0


class SteppedError(InputError):
    """An environment was stepped when it could not be, or by what are no actions."""


class Episodes:
    """One match at a time.

    Parameters
    ----------
    ruleset
        By name, file or value.
    reward
        `score`: the change of the own score, by which a match's rewards sum up to its score / 100. `outcome`: 1 for a match that
        was won, -1 for one that was lost, at its end, else 0.
    frame
        As `TeamView` has it: what is observed, and what actions mean.
    layout
        `dict`: an observation is a dictionary of arrays. `box`: one array, as `gymnasium.spaces.flatten` makes it of that.
    """

    def __init__(self, ruleset: Ruleset | str, reward: str, render_mode: str | None, frame: str, layout: str) -> None:
        self.ruleset = load_rules(ruleset)
        check_reward(reward)
        check_layout(layout)
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise UnknownNameError("render mode", render_mode, RENDER_MODES)
        self._reward, self._render_mode = reward, render_mode
        self._views = {team: TeamView(self.ruleset, team, frame) for team in Team}
        self.game = BatchedGame(self.ruleset, 1)
        self.seen = self.game.observe()
        self._secret, self._n_begun = new_secret(), 0
        self._score = 0

    def begin(self, seed: int | None, options: Mapping[str, Any] | None) -> None:
        """Begin a match: the first of a seed, the next of the last seed, or the one of `options["keys"]`."""
        if seed is not None:
            self._secret, self._n_begun = secret_from_seed(seed), 0
        keys = (options or {}).get("keys")
        if keys is None:
            keys = keys_of(self._secret, self._n_begun)
            self._n_begun += 1
        self.game.start([0], [keys])
        self.game.observe()
        self._score = 0
        self._show()

    @property
    def ending(self) -> Termination:
        """How the match ended; `RUNNING` until then. A match that has not begun counts as ended."""
        return Termination(int(self.game.state.field[0, StateField.ENDING]))

    def check_running(self) -> None:
        """Raise unless a match runs."""
        if self.ending is not Termination.RUNNING:
            raise SteppedError("there is no match to step: it is over, or none was begun; call reset() first")

    def observe(self, team: Team) -> ObservationDict:
        """Return what a team knows."""
        return {name: values[0] for name, values in self._views[team].read(self.seen[team]).items()}

    def to_orders(self, team: Team, actions: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return a team's actions, shape (units,), as the game takes them: chosen for what was observed last."""
        orders: NDArray[np.int8] = self._views[team].to_orders(actions[None])[0]
        return orders

    def step(self, orders: Mapping[Team, NDArray[np.int8]]) -> float:
        """Play a tick by orders as the game takes them, and return blue's reward; red's is its negative."""
        self.game.play(np.concatenate((orders[Team.BLUE], orders[Team.RED]))[None, :])
        before, self._score = self._score, int(self.game.state.field[0, StateField.SCORE])
        self._show()
        if self._reward == "score":
            return (self._score - before) / FULL_SCORE
        return 0.0 if self.ending is Termination.RUNNING else float(np.sign(self._score))

    def info(self) -> dict[str, Any]:
        """Return what stands beside an observation: the match's `Termination`, as a number, which every framework takes."""
        return {"ending": int(self.ending)}

    def render(self) -> str | NDArray[np.uint8] | None:
        """Return the true board, as letters or as a picture; None where nobody wants it, or it is shown at every tick."""
        if self._render_mode == "ansi":
            return draw_letters(self.game.truth(0))
        return paint(self.game.truth(0)) if self._render_mode == "rgb_array" else None

    def _show(self) -> None:
        if self._render_mode == "human":
            show(self.game.truth(0))


def abandoned(ticks: int) -> MatchResult:
    """Return what an opponent hears of a match in whose place another begins."""
    reason = "another match was begun in its place"
    return MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=ticks, reason=reason)


def keys_of(secret: bytes, number: int) -> MatchKeys:
    """Return the keys of one match of many."""
    return MatchKeys(map_key=derive_map_key(secret, "episode", number), match_key=derive_match_key(secret, f"episode/{number}"))


def check_reward(reward: str) -> None:
    """Raise `UnknownNameError` unless there is such a reward."""
    if reward not in REWARDS:
        raise UnknownNameError("reward", reward, REWARDS)


def read_orders(actions: Any, shape: tuple[int, ...], who: str) -> NDArray[np.int8]:
    """Return orders of a shape whose last axis is that of units; `SteppedError` unless they are one action for each."""
    try:
        orders = np.asarray(actions)
    except ValueError:  # no array at all: its rows have different lengths
        orders = np.empty(0)
    if orders.shape != shape or orders.dtype.kind not in "iu" or (orders.size and (orders.min() < 0 or orders.max() > _LAST)):
        n_orders = " x ".join(map(str, shape))
        raise SteppedError(f"the actions of {who} must be {n_orders} whole numbers from 0 to {_LAST}, not {actions!r}")
    return orders.astype(np.int8)
