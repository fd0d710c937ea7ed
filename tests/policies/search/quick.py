"""Planners that think as little as they can, and matches for them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import BatchFactory, BatchPolicy
from policies.search.planner import LEAST_BUDGET, PlannerDeep, PlannerFast


class Quick(PlannerFast):
    """One line of thought."""

    name = "quick"
    budget = LEAST_BUDGET
    n_worlds = 16


DARING = {"is_sure": -1e9}
"""Settings of a planner that plays what it has found, however unsure it is; what it searches decides all that it does."""


class Daring(Quick):
    """One line of thought, and no doubt."""

    settings = DARING


class DaringDeep(PlannerDeep):
    """Several lines of thought, each as short."""

    name = "quick-deep"
    budget = PlannerDeep.n_lines * LEAST_BUDGET
    settings = DARING
    n_worlds = 16


def begin_games(ruleset: Ruleset, seeds: Sequence[int]) -> BatchedGame:
    """Return games of which each follows from its seed, below 256."""
    games = BatchedGame(ruleset, len(seeds))
    games.start(range(len(seeds)), [MatchKeys(map_key=bytes([seed] * 32), match_key=bytes([seed + 1] * 32)) for seed in seeds])
    return games


def seat(make: BatchFactory, ruleset: Ruleset, team: Team, n_seats: int = 1) -> BatchPolicy:
    """Return a fighter at the start of its matches."""
    fighter = make(ruleset, team, n_seats)
    fighter.start(np.arange(n_seats))
    return fighter


def decide(fighter: BatchPolicy, observations: Observations) -> NDArray[np.int8]:
    """Return a tick's orders; shape (seats, own units)."""
    orders = np.zeros(observations.cell.shape, np.int8)
    fighter.act(observations, orders)
    return orders


def play_tick(games: BatchedGame, fighters: Mapping[Team, BatchPolicy]) -> dict[Team, NDArray[np.int8]]:
    """Play one tick, and return what each team ordered."""
    seen = games.observe()
    orders = {team: decide(fighters[team], seen[team]) for team in Team}
    games.step(np.concatenate([orders[team] for team in Team], axis=1))
    return orders
