"""Planners: what a playout costs beside the bare rules, how long each thinks about a turn, and what a seat of it remembers."""

import tracemalloc
from collections.abc import Callable
from itertools import count
from statistics import median, quantiles
from typing import Any

import numpy as np

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import load as load_rules
from arena.game.state import StateField
from arena.game.types import Team
from benchmarks.measuring.rates import Work, paired_rates
from benchmarks.measuring.turns import Games, time_turns
from policies.heuristics.role_team import RoleTeam
from policies.search.climb import BLUEPRINT, Effort, try_plan
from policies.search.mind import Mind
from policies.search.planner import Planner, PlannerDeep, PlannerFast
from policies.search.playout import Bench

PLANNERS: dict[str, type[Planner]] = {"planner-fast": PlannerFast, "planner": Planner, "planner-deep": PlannerDeep}
WORLDS, HORIZON = 64, 30
"""Worlds in a batch, and ticks of a playout."""
_TURNS, _MOST_S = 300, 10.0
_FIRST_TURNS = 5
"""Which warm it up, and which are played while memory is looked at."""


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Microseconds of a playout beside the bare rules, and milliseconds a turn and megabytes a seat of each planner."""
    progress("playouts")
    results: dict[str, Any] = {"playout": _measure_playouts()}
    for name, planner in PLANNERS.items():
        progress(name)
        results[name] = _measure_planner(planner)
    return results


def _measure_playouts() -> dict[str, Any]:
    """Return what a playout takes, and what the rules alone take for as many ticks of as many units, by turns on one core."""
    games = BatchedGame(load_rules("paper"), WORLDS)
    chance = np.random.default_rng(0)
    games.start(range(WORLDS), [MatchKeys(map_key=chance.bytes(32), match_key=chance.bytes(32)) for _ in range(WORLDS)])
    playing, bench = _playouts_of(games)
    playouts, bare, ratio = paired_rates(playing, _steps_of(games, chance))
    return {
        "us": round(1e6 / playouts, 3),
        "rules_us": round(1e6 / bare, 3),
        "over_rules": round(1 / ratio, 3),
        "per_s": round(playouts),
        "ticks": round(float(np.mean(bench.then.state.field[:, StateField.TICK])), 1),
    }


def _playouts_of(games: BatchedGame) -> tuple[Work, Bench]:
    """Return work that plays the blueprint out in worlds that may be when a match begins, and returns how many; and its bench."""
    mind = Mind(games.ruleset, Team.BLUE, WORLDS, n_lines=1)
    mind.act(games.observe()[Team.BLUE].select(slice(1)), Effort.of(1), None)
    plans, bench, effort, seeds = mind.plans[0], mind.benches[0], Effort.of(1)._replace(horizon=HORIZON), count()

    def work() -> int:
        plans.n_tried[BLUEPRINT] = 0
        return try_plan(BLUEPRINT, WORLDS, int(Team.BLUE), plans, bench, effort, np.uint64(next(seeds)))

    return work, bench


def _steps_of(games: BatchedGame, chance: np.random.Generator) -> Work:
    """Return work that plays as many games for as many ticks by the rules alone, all units ordered at random."""
    arrays = [np.asarray(array) for array in games.state]
    begin = [array.copy() for array in arrays]
    orders = chance.integers(0, 5, (HORIZON, *games.state.cell.shape), dtype=np.int8)

    def work() -> int:
        for array, before in zip(arrays, begin, strict=True):
            array[:] = before
        for tick in orders:
            games.step(tick)
        return WORLDS

    return work


def _measure_planner(planner: type[Planner]) -> dict[str, Any]:
    """Return what a planner takes for its turns against its own blueprint, where no clock runs, and what a seat of it holds."""
    time_turns(planner, RoleTeam, 1, _FIRST_TURNS, _MOST_S)
    memory_bytes = _measure_memory(planner)
    taken_ms = [taken_ns / 1e6 for taken_ns in time_turns(planner, RoleTeam, 1, _TURNS, _MOST_S)]
    return {
        "budget": planner.budget,
        "ms": round(median(taken_ms), 2),
        "p99_ms": round(quantiles(taken_ms, n=100)[98], 2),
        "memory_mb": round(memory_bytes / 1e6, 1),
    }


def _measure_memory(planner: type[Planner]) -> int:
    """Return the most bytes that Python and numpy hold at once for a game, its two fighters and some turns."""
    tracemalloc.start()
    try:
        games = Games(planner, RoleTeam, 1)
        for _ in range(_FIRST_TURNS):
            games.play_tick()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
