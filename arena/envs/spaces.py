"""The spaces of what a team knows and may do; `arena.envs.views` writes the arrays."""

from typing import Any

import numpy as np
from gymnasium import spaces

from arena.envs.views import N_SIGHTED, N_TRAITS, PUBLIC
from arena.game.observation_fields import FieldSpec
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Code, Team


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
            **{name: _box(spec, ruleset, team) for name, spec in PUBLIC.items()},
            "legal_actions": spaces.Box(0, 1, (n_own, len(Action)), np.int8),
        }
    )


def _box(spec: FieldSpec, ruleset: Ruleset, team: Team) -> spaces.Box:
    values = spec.values_of(ruleset, team) or (np.iinfo(spec.dtype).min, np.iinfo(spec.dtype).max)
    return spaces.Box(values[0], values[-1], spec.shape_of(ruleset, team) or (1,), spec.dtype)


def laid_out(space: spaces.Dict, layout: str) -> spaces.Space[Any]:
    """Return the space of observations that `arena.envs.views.lay_out` has laid out."""
    return space if layout == "dict" else spaces.flatten_space(space)


def state_space(ruleset: Ruleset) -> spaces.Box:
    """Return the space of the true board, in the codes of the paper's Table 2."""
    return spaces.Box(0, int(max(Code)), (ruleset.side, ruleset.side), np.int8)


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
