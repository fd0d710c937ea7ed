"""The rules as they are played, in the local venue and in training: a step under random orders, what both teams see of it, and a
start with fresh keys where a game has ended.

With the environment variable ARENA_YARDSTICK, the folder of another kernel (`ctfkernel.py`), both run by turns and the ratio is
given: its batched game has the same shape of work.
"""

import importlib
import os
import sys
from collections.abc import Callable
from itertools import cycle, islice
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from arena.errors import InputError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import load
from benchmarks.measuring.rates import RUNS, Work, median_rate, paired_rates, rate, threaded_rate

RULES = ("paper", "gym-cap")
BATCHES = (1, 64, 1024, 4096)
HEADLINE_BATCH = 64
_TICKS_PER_CALL = 2048
_N_KEYS = 4096


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Ticks per second of the rules kernel, by ruleset, batch and threads."""
    yardstick = _yardstick_folder()
    return {name: _measure(name, yardstick, progress) for name in RULES}


def _yardstick_folder() -> Path | None:
    """Return where the other kernel stands; a wrong place is said before anything is measured."""
    folder = os.environ.get("ARENA_YARDSTICK")
    if not folder:
        return None
    if not (Path(folder) / "ctfkernel.py").exists():
        raise InputError(f"ARENA_YARDSTICK is {folder}; there is no ctfkernel.py")
    return Path(folder)


def _measure(name: str, yardstick: Path | None, progress: Callable[[str], None]) -> dict[str, Any]:
    results: dict[str, Any] = {}
    by_batch = {}
    for batch in BATCHES:
        progress(f"{name}, batch {batch}")
        one = median_rate(make_work(name, batch))
        pair = [make_work(name, batch, seed) for seed in (1, 2)]
        alone_and_both = [(rate(pair[0]), threaded_rate(pair)) for _ in range(RUNS)]
        by_batch[str(batch)] = {
            "one_thread": round(one),
            "two_threads": round(median(both for _, both in alone_and_both)),
            "two_over_one": round(median(both / alone for alone, both in alone_and_both), 3),
        }
    results["ticks_per_s"] = by_batch[str(HEADLINE_BATCH)]["one_thread"]
    results["batch"] = by_batch
    if yardstick is not None:
        progress(f"{name}, beside the yardstick")
        ours, theirs, ratio = paired_rates(make_work(name, HEADLINE_BATCH), _yardstick_work(yardstick))
        results["yardstick"] = {"ours": round(ours), "yardstick": round(theirs), "ratio": round(ratio, 3)}
    return results


def make_work(name: str, batch: int, seed: int = 0) -> Work:
    """Return work that plays random ticks of a batch of its own and returns how many."""
    chance = np.random.default_rng(seed)
    games = BatchedGame(load(name), batch)
    keys = cycle([MatchKeys(map_key=chance.bytes(32), match_key=chance.bytes(32)) for _ in range(_N_KEYS)])
    orders = [chance.integers(0, 5, games.state.cell.shape, dtype=np.int8) for _ in range(16)]
    calls = max(1, _TICKS_PER_CALL // batch)

    def work() -> int:
        for call in range(calls):
            if len(over := np.flatnonzero(games.is_over)):
                games.start(over, list(islice(keys, len(over))))
            games.observe()
            games.step(orders[call & 15])
        return calls * batch

    for _ in range(max(1, 200 // calls)):  # until games are at all stages
        work()
    return work


def _yardstick_work(folder: Path) -> Work:
    sys.path.append(str(folder))
    kernel = importlib.import_module("ctfkernel")
    games = kernel.Games(HEADLINE_BATCH)
    orders = [np.random.default_rng(n).integers(0, 5, (HEADLINE_BATCH, 12), dtype=np.uint8) for n in range(16)]
    calls, flat_bits = _TICKS_PER_CALL // HEADLINE_BATCH, 5

    def work() -> int:
        for call in range(calls):
            games.step(orders[call & 15], flat_bits)
        return calls * HEADLINE_BATCH

    for _ in range(10):
        work()
    return work
