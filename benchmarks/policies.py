"""The fighters: what a seat and tick of each costs, in nanoseconds, on observations of real games."""

import time
from collections.abc import Callable
from statistics import median, quantiles
from typing import Any

import numpy as np

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from benchmarks.measuring.rates import RUNS
from policies.registry import load, names

BATCHES = (1024, 1)
_TICKS = {1024: 60, 1: 2000}


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Nanoseconds per seat and tick of each fighter, in a batch and alone."""
    results: dict[str, Any] = {}
    for name in names():
        progress(name)
        results[name] = {}
        for batch in BATCHES:
            _time_ticks(name, batch)
            runs = [_time_ticks(name, batch) for _ in range(RUNS)]
            results[name][f"batch_{batch}_ns"] = round(median(median(run) for run in runs) / batch)
        results[name]["batch_1_p99_ns"] = round(median(quantiles(run, n=100)[98] for run in runs))
    return results


def _time_ticks(name: str, batch: int) -> list[int]:
    """Return what each call of `act` took, in nanoseconds, over games against a fighter that walks at random."""
    ruleset = load_rules("paper")
    games = BatchedGame(ruleset, batch)
    fighter = load(name)(ruleset, Team.BLUE, batch)
    orders = np.zeros(games.state.cell.shape, np.int8)
    own = np.zeros((batch, games.n_units[Team.BLUE]), np.int8)
    chance = np.random.default_rng(0)
    secret = secret_from_seed(0)
    taken: list[int] = []
    episode = 0
    while len(taken) < _TICKS[batch]:
        rows = np.flatnonzero(games.is_over)
        if len(rows):
            keys = [
                MatchKeys(map_key=derive_map_key(secret, name, episode + i), match_key=derive_match_key(secret, f"{episode + i}"))
                for i in range(len(rows))
            ]
            episode += len(rows)
            games.start(rows, keys)
            fighter.start(rows)
        seen = games.observe()[Team.BLUE]
        begin = time.perf_counter_ns()
        fighter.act(seen, own)
        taken.append(time.perf_counter_ns() - begin)
        orders[:, : own.shape[1]] = own
        orders[:, own.shape[1] :] = chance.integers(0, 5, orders[:, own.shape[1] :].shape)
        games.step(orders)
    return taken
