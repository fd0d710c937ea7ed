"""What a team knows, as the arrays that an environment gives: from a batch of observations, or from a bot's single one."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.envs.compiled import compile_finder, compile_writer
from arena.errors import InputError, UnknownNameError
from arena.game.observation import FIELDS, Observation, Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import FLAGS, HALVES, UAVS, UGVS, Action, Code, Team

ObservationDict = dict[str, NDArray[Any]]
Shown = ObservationDict | NDArray[Any]
"""An observation as the layout has it."""
FRAMES = ("board", "own")
LAYOUTS = ("dict", "box")
N_TRAITS = 4
"""Of a unit: row, column, type (index into `Ruleset.units`), whether it lives."""
N_SIGHTED = 3
"""Of an enemy in sight: row, column, type; all -1 where there is none."""
PUBLIC = {name: spec for name, spec in FIELDS.items() if spec.is_public}
_READ = {name: FIELDS[name].dtype for name in ("ground", "cell", "alive", "enemy_cell", "enemy_type")}
_CODES = np.arange(len(Code), dtype=np.int8) + np.int8(Code.HIDDEN)
_ACTIONS = np.array([list(Action), [Action.STAY, Action.NORTH, Action.WEST, Action.SOUTH, Action.EAST]], np.int8)
"""What each action is on the board as it is, and on one that is turned over."""
_find_turned = compile_finder()


class TeamView:
    """Writes what one team knows, as `arena.envs.spaces.team_space` describes it.

    Parameters
    ----------
    frame
        `board`: as the board is. `own`: as if the team were blue and its half the western one, whichever it is and wherever that
        lies. Its own units, half and flag have blue's codes, and where its half is the eastern one, east and west change places.
        So a network that was trained on one side plays the other, too, and the enemy is always east. On which side the own half
        lies is told by most of the cells in sight; a team that sees nothing any more is shown the board as it is.
    """

    def __init__(self, ruleset: Ruleset, team: Team, frame: str = "board") -> None:
        self.ruleset, self.team, self._frame = ruleset, team, frame
        self._is_turned = _find(frame, team, np.full((1, ruleset.side**2), Code.HIDDEN, np.int8), ruleset.side)
        codes = _CODES.copy()
        if frame == "own" and team is Team.RED:
            for pair in (HALVES, UGVS, UAVS, FLAGS):
                codes[np.array(pair) - Code.HIDDEN] = pair[::-1]
        stamps = [[codes[kind[side] - Code.HIDDEN] for kind in (UGVS, UAVS)] for side in (team.other, team)]
        types = [ruleset.units.index(kind) for kind in ruleset.team(team)]
        self._tables = (
            codes,
            _ACTIONS,
            np.array(stamps, np.int8),
            np.array(types, np.int8),
            np.array([kind.flies for kind in ruleset.units], np.uint8),
        )
        blank = Observations.blank(ruleset, team, 1)
        self._write = compile_writer(self._is_turned, *self._tables, *self._inputs(blank), *self._outputs(1).values())

    def read(self, seen: Observations) -> ObservationDict:
        """Return what the team knows in every match, freshly made, each array with a leading axis of matches."""
        view = self._outputs(len(seen))
        self._is_turned = _find(self._frame, self.team, seen.ground, self.ruleset.side)
        self._write(self._is_turned, *self._tables, *self._inputs(seen), *view.values())
        legal = view.pop("legal_actions")
        for name in PUBLIC:
            view[name] = getattr(seen, name).copy().reshape(len(seen), -1)
        view["legal_actions"] = legal
        return view

    def to_orders(self, actions: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return actions that were chosen by the last view, shape (n, units), as the game takes them."""
        return _turn(actions, self._is_turned)

    def _inputs(self, seen: Observations) -> list[NDArray[Any]]:
        return [np.ascontiguousarray(getattr(seen, name), dtype) for name, dtype in _READ.items()]

    def _outputs(self, n: int) -> ObservationDict:
        side, n_own, n_enemies = self.ruleset.side, len(self.ruleset.team(self.team)), len(self.ruleset.team(self.team.other))
        return {
            "grid": np.empty((n, side, side), np.int8),
            "units": np.empty((n, n_own, N_TRAITS), np.int16),
            "enemies": np.empty((n, n_enemies, N_SIGHTED), np.int16),
            "legal_actions": np.empty((n, n_own, len(Action)), np.int8),
        }


def unit_dict(known: Mapping[str, NDArray[Any]], unit: int) -> ObservationDict:
    """Return one unit's part of what its team knows in one match, freshly made."""
    part = {name: values.copy() for name, values in known.items() if name != "legal_actions"}
    part["self"], part["action_mask"] = known["units"][unit].copy(), known["legal_actions"][unit].copy()
    return part


def lay_out(known: ObservationDict, layout: str) -> Shown:
    """Return what is known as an observation: as it is, or with the layout `box` as one array.

    The array has every number of the dictionary, in the order of `gymnasium.spaces.flatten`; axes before those of `grid` stay.
    """
    if layout == "dict":
        return known
    lead = known["grid"].shape[:-2]
    return np.concatenate([known[name].reshape(*lead, -1) for name in sorted(known)], axis=-1)


def check_layout(layout: str) -> None:
    """Raise `UnknownNameError` unless there is such a layout."""
    if layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)


def as_observation(
    observation: Observation,
    ruleset: Ruleset | str = "paper",
    *,
    frame: str = "board",
    layout: str = "dict",
    unit: int | None = None,
) -> Shown:
    """Return the observation of a bot as the environments give it for the same state.

    So a network that was trained in an environment plays as a bot; with `frame="own"`, `as_orders` turns its actions back.

    Parameters
    ----------
    ruleset
        That of the match, by name, file or value: `MatchInfo.ruleset`. A file is read once.
    frame, layout
        As the environment was made.
    unit
        The unit that asks, where every unit is an agent of its own; None for the whole team.

    Raises
    ------
    InputError
        The observation is not of a match under this ruleset.
    """
    check_layout(layout)
    view = _view(ruleset, observation.team, frame)
    rules = view.ruleset
    index = {kind.name: number for number, kind in enumerate(rules.units)}
    team = [kind.name for kind in rules.team(observation.team)]
    is_strange = any(enemy.type not in index for enemy in observation.enemies)
    is_strange |= observation.living[1] > len(rules.team(observation.team.other))
    if is_strange or len(observation.ground) != rules.side or [one.type for one in observation.units] != team:
        raise InputError(
            f"the observation is of no team of the ruleset {rules.name} on {rules.side} x {rules.side} cells; "
            "pass the ruleset of its match, MatchInfo.ruleset"
        )
    seen = Observations.blank(rules, observation.team, 1)
    seen.tick[0], seen.score[0], seen.living[0] = observation.tick, observation.score, observation.living
    side = seen.side
    seen.ground[0, : side * side] = observation.ground.ravel()
    seen.cell[0] = [one.row * side + one.column for one in observation.units]
    seen.alive[0] = [one.alive for one in observation.units]
    n_enemies = len(observation.enemies)
    seen.enemy_cell[0, :n_enemies] = [enemy.row * side + enemy.column for enemy in observation.enemies]
    seen.enemy_type[0, :n_enemies] = [index[enemy.type] for enemy in observation.enemies]
    whole = {name: values[0] for name, values in view.read(seen).items()}
    return lay_out(whole if unit is None else unit_dict(whole, unit), layout)


def as_observations(
    observations: Observations, ruleset: Ruleset | str = "paper", *, frame: str = "board", layout: str = "dict"
) -> Shown:
    """Return the observations of a `BatchPolicy` as `VectorCapture` gives them, with a leading axis of seats."""
    check_layout(layout)
    return lay_out(_view(ruleset, observations.team, frame).read(observations), layout)


def as_orders(actions: Any, seen: Observation | Observations, *, frame: str = "own") -> NDArray[np.int8]:
    """Return actions that were chosen in a frame as orders.

    Parameters
    ----------
    actions
        For an `Observation`, of any shape; for `Observations`, with a leading axis of seats.
    seen
        What they were chosen for.
    """
    if isinstance(seen, Observation):
        side = len(seen.ground)
        return _turn(np.asarray(actions, np.int8), _find(frame, seen.team, seen.ground.reshape(1, -1), side)[0])
    return _turn(np.asarray(actions, np.int8), _find(frame, seen.team, seen.ground, seen.side))


def _find(frame: str, team: Team, ground: NDArray[np.int8], side: int) -> NDArray[np.bool_]:
    """Return in which matches what is east on the board is west in a team's frame, shape (n,)."""
    if frame not in FRAMES:
        raise UnknownNameError("frame", frame, FRAMES)
    is_turned = np.zeros(len(ground), np.bool_)
    if frame == "own":
        _find_turned(np.ascontiguousarray(ground, np.int8), side, int(team), is_turned)
    return is_turned


def _turn(actions: NDArray[np.int8], is_turned: NDArray[np.bool_] | np.bool_) -> NDArray[np.int8]:
    """Return actions with east and west exchanged where the board is turned over."""
    if not is_turned.any():
        return actions
    which = is_turned.reshape(is_turned.shape + (1,) * (actions.ndim - is_turned.ndim)).astype(np.intp)
    turned: NDArray[np.int8] = _ACTIONS[which, actions]
    return turned


def load_rules(ruleset: Ruleset | str) -> Ruleset:
    """Return a ruleset that may have been named."""
    return load(ruleset) if isinstance(ruleset, str) else ruleset


@lru_cache(maxsize=16)
def _view(ruleset: Ruleset | str, team: Team, frame: str) -> TeamView:
    return TeamView(load_rules(ruleset), team, frame)


def prepare() -> None:
    """Compile, or load, what writes views, under any rules."""
    TeamView(load("paper"), Team.BLUE)


prepare()  # a bot's file imports this before its match begins, so that nothing is compiled while its clock runs
