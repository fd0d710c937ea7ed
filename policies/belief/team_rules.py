"""A ruleset as kernels read it, from the side of one team."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.rules import reach_of
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Team


class TeamRules(NamedTuple):
    """A ruleset as one team's kernels read it: its own units, the enemy's, and which codes of a cell are whose."""

    side: int
    tick_limit: int
    is_combat_random: bool
    self_counts: bool
    flies: NDArray[np.uint8]
    """Shape (own units,)."""
    step: NDArray[np.int64]
    """Shape (own units,): cells per tick."""
    sight_cells: NDArray[np.int64]
    """Shape (own units,)."""
    reach: NDArray[np.int64]
    """Shape (own units,): greatest squared distance at which it hits; -1 for none."""
    strength: NDArray[np.int64]
    """Shape (own units,)."""
    type_reach: NDArray[np.int64]
    """Shape (unit types,): as `reach`, by `Observations.enemy_type`."""
    type_strength: NDArray[np.int64]
    """Shape (unit types,)."""
    type_step: NDArray[np.int64]
    """Shape (unit types,)."""
    n_enemy_walkers: int
    n_enemy_flyers: int
    """They cannot be hit: the rest of the living enemies are on foot."""
    enemy_step: int
    """Most cells that an enemy on foot moves in a tick."""
    own_half: int
    """Code of a cell, as the three that follow."""
    enemy_half: int
    own_flag: int
    enemy_flag: int


def team_rules(ruleset: Ruleset, team: Team) -> TeamRules:
    """Return a ruleset as the kernels of `team` read it."""
    own, enemies = ruleset.team(team), ruleset.team(team.other)
    reach = {unit.name: reach_of(unit.attack, ruleset.attack_at_range, unit.flies) for unit in ruleset.units}

    def numbers(values: Iterable[int]) -> NDArray[np.int64]:
        return np.array(list(values), np.int64)

    return TeamRules(
        side=ruleset.side,
        tick_limit=ruleset.tick_limit,
        is_combat_random=ruleset.random_combat,
        self_counts=ruleset.self_counts,
        flies=np.array([unit.flies for unit in own], np.uint8),
        step=numbers(unit.step for unit in own),
        sight_cells=numbers(unit.sight for unit in own),
        reach=numbers(reach[unit.name] for unit in own),
        strength=numbers(unit.strength for unit in own),
        type_reach=numbers(reach[unit.name] for unit in ruleset.units),
        type_strength=numbers(unit.strength for unit in ruleset.units),
        type_step=numbers(unit.step for unit in ruleset.units),
        n_enemy_walkers=sum(not unit.flies for unit in enemies),
        n_enemy_flyers=sum(unit.flies for unit in enemies),
        enemy_step=max((unit.step for unit in enemies if not unit.flies), default=0),
        own_half=int(HALVES[team]), enemy_half=int(HALVES[team.other]),
        own_flag=int(FLAGS[team]), enemy_flag=int(FLAGS[team.other]),
    )  # fmt: skip
