"""The fighters: what a seat and tick of each costs, in nanoseconds, on observations of real games.

Alone, they are told how long a turn may take, as in a pit, and the share of turns that take longer is given as `late`.
"""

import time
from collections.abc import Callable
from functools import partial
from statistics import median, quantiles
from typing import Any

import numpy as np

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from benchmarks.measuring.rates import RUNS
from policies.registry import load, names

MOST_SEATS = 1024
"""In a batch; fewer where fewer suit a fighter."""
TURN_TIME_S = 0.1
_TICKS, _TICKS_ALONE = 60, 2000
_MOST_S = 5.0
"""Of thinking, in one run."""


def run(progress: Callable[[str], None], turn_time: float = TURN_TIME_S) -> dict[str, Any]:
    """Nanoseconds per seat and tick of each fighter, in a batch and alone, and which share of its turns is late."""
    results: dict[str, Any] = {}
    for name in names():
        progress(name)
        batch = min(getattr(load(name), "most_seats", MOST_SEATS), MOST_SEATS)
        together = _repeat(partial(_time_ticks, name, batch, _TICKS))
        alone = _repeat(partial(_time_ticks, name, 1, _TICKS_ALONE, turn_time))
        taken_s = np.concatenate(alone) / 1e9
        results[name] = {
            f"batch_{batch}_ns": round(median(map(median, together)) / batch),
            "batch_1_ns": round(median(map(median, alone))),
            "batch_1_p99_ns": round(median(quantiles(run, n=100)[98] for run in alone)),
            "late": round(float(np.mean(taken_s > turn_time)), 5),
        }
    return results


def _repeat(time_ticks: Callable[[], list[int]]) -> list[list[int]]:
    """Return what several runs give, after one to warm up."""
    return [time_ticks() for _ in range(RUNS + 1)][1:]


def _time_ticks(name: str, batch: int, n_ticks: int, turn_time_s: float | None = None) -> list[int]:
    """Return what each call of `act` took, in nanoseconds, over games against a fighter that walks at random."""
    ruleset = load_rules("paper")
    games = BatchedGame(ruleset, batch)
    fighter = load(name)(ruleset, Team.BLUE, batch)
    if turn_time_s is not None:
        fighter.set_turn_time(turn_time_s)
    orders = np.zeros(games.state.cell.shape, np.int8)
    own = np.zeros((batch, games.n_units[Team.BLUE]), np.int8)
    chance = np.random.default_rng(0)
    secret = secret_from_seed(0)
    taken: list[int] = []
    episode = 0
    while len(taken) < n_ticks and sum(taken) < _MOST_S * 1e9:
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
