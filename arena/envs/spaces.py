"""What a team knows, as the arrays and spaces of an environment; the same for one match and for a batch of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from arena.game.engine import BatchedGame
from arena.game.observation import FIELDS, find_legal_actions
from arena.game.observation_fields import FieldSpec
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Code, Team

ObservationDict = dict[str, NDArray[Any]]
N_TRAITS = 4
"""Of a unit: row, column, type (index into `Ruleset.units`), whether it lives."""
N_SIGHTED = 3
"""Of an enemy in sight: row, column, type; all -1 where there is none."""
_PUBLIC = {name: spec for name, spec in FIELDS.items() if spec.is_public}


def team_dict(games: BatchedGame, team: Team) -> ObservationDict:
    """Return what a team knows in every game, freshly made; `team_space` names the parts, which have a leading axis of games."""
    seen, ruleset, side = games.observe()[team], games.ruleset, games.ruleset.side
    kinds = ruleset.team(team)
    types = np.array([ruleset.units.index(kind) for kind in kinds])
    flies = np.array([kind.flies for kind in kinds])
    units = np.stack([*_places(seen.cell, side), np.broadcast_to(types, seen.cell.shape), seen.alive], axis=-1)
    enemies = np.stack([*_places(seen.enemy_cell, side), seen.enemy_type], axis=-1)
    enemies[seen.enemy_cell < 0] = -1
    return {
        "grid": games.grids()[team],
        "units": units.astype(np.int16),
        "enemies": enemies.astype(np.int16),
        **{name: getattr(seen, name).copy().reshape(len(seen), -1) for name in _PUBLIC},
        "legal_actions": find_legal_actions(seen.ground, side, seen.cell, seen.alive, flies).astype(np.int8),
    }


def _places(cell: NDArray[np.int16], side: int) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
    return cell // side, cell % side


def team_space(ruleset: Ruleset, team: Team) -> spaces.Dict:
    """Return the space of what a team knows.

    `grid` is the board in the codes of the paper's Table 2, -1 where it is hidden; `units` and `enemies` are rows of `N_TRAITS`
    and `N_SIGHTED` numbers; `legal_actions` has a 1 for each order that can move a unit. The rest are the public fields of
    `arena.game.observation.FIELDS`: `living` counts own units and enemies, `score` is the own one.
    """
    n_own, n_enemies, side = len(ruleset.team(team)), len(ruleset.team(team.other)), ruleset.side
    most = max(side, len(ruleset.units))
    return spaces.Dict(
        {
            "grid": spaces.Box(int(min(Code)), int(max(Code)), (side, side), np.int8),
            "units": spaces.Box(0, most, (n_own, N_TRAITS), np.int16),
            "enemies": spaces.Box(-1, most, (n_enemies, N_SIGHTED), np.int16),
            **{name: _box(spec, ruleset, team) for name, spec in _PUBLIC.items()},
            "legal_actions": spaces.Box(0, 1, (n_own, len(Action)), np.int8),
        }
    )


def _box(spec: FieldSpec, ruleset: Ruleset, team: Team) -> spaces.Box:
    values = spec.values_of(ruleset, team) or (np.iinfo(spec.dtype).min, np.iinfo(spec.dtype).max)
    return spaces.Box(values[0], values[-1], spec.shape_of(ruleset, team) or (1,), spec.dtype)


def order_space(ruleset: Ruleset, team: Team) -> spaces.MultiDiscrete:
    """Return the space of a team's orders: an action for each unit."""
    return spaces.MultiDiscrete([len(Action)] * len(ruleset.team(team)))


def unit_space(ruleset: Ruleset, team: Team) -> spaces.Dict:
    """Return the space of what one unit knows: all that its team knows, its own row of `units`, and its `action_mask`."""
    whole = dict(team_space(ruleset, team).spaces)
    del whole["legal_actions"]
    whole["self"] = spaces.Box(0, max(ruleset.side, len(ruleset.units)), (N_TRAITS,), np.int16)
    whole["action_mask"] = spaces.Box(0, 1, (len(Action),), np.int8)
    return spaces.Dict(whole)


def unit_dict(known: Mapping[str, NDArray[Any]], unit: int) -> ObservationDict:
    """Return one unit's part of what its team knows in one match, freshly made."""
    part = {name: values.copy() for name, values in known.items() if name != "legal_actions"}
    return {**part, "self": known["units"][unit].copy(), "action_mask": known["legal_actions"][unit].copy()}
