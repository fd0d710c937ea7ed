"""Training: how much of a loop's time is the network's own compute, and how near that comes to what the cores can multiply.

The paper's method is measured on the network of Table 5, whose size is fixed: the game, the views, the replay and the bookkeeping
are what is left of the loop. It uses as many threads as OMP_NUM_THREADS says, or one per core. PPO is measured on one core, as a
process of `arena train` has it, with trunks of several sizes. Where others work too, both measure them.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
import torch

from arena.envs.batched import BatchedEnv
from arena.errors import ArenaError
from arena.game.ruleset import load as load_rules
from benchmarks.measuring import ppo_loop
from benchmarks.measuring.rates import RUNS, median_rate
from policies.networks.models import PaperTeam
from policies.networks.precision import has_fast_bf16, precision_of
from policies.training.allocator import KEEP
from policies.training.parallel import Processes
from policies.training.reinforce import Reinforcer
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.replay import Samples
from policies.training.trajectories import RoundPlayer

BATCH, MATCHES, MULTIPLIED = 2_000, 64, 2_048
GAMES, HORIZON = 128, 16
"""Of the loop of PPO: enough for passes of full chunks."""
TRUNKS = ((24, 2), (32, 3), (48, 3))
_PASSES = 3
"""Of a training step, in forward passes: one forward, and two backward, to the inputs and to the weights."""


class Clock(PaperTeam):
    """A network that adds up the time spent in it."""

    def __init__(self, network: PaperTeam) -> None:
        super().__init__(network.window, network.agents, network.planes, network.edge)
        self.members, self.seconds = network.members, 0.0

    def forward(self, views: torch.Tensor, unit: torch.Tensor) -> torch.Tensor:
        begin = time.perf_counter()
        logits = super().forward(views, unit)
        self.seconds += time.perf_counter() - begin
        return logits


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Samples per second of back-propagation and of whole loops, and how near they come to the cores' roof."""
    variants = {"fp32_as_it_comes": (False, {}), "fp32": (False, KEEP)}
    if has_fast_bf16():
        variants["bf16"] = (True, KEEP)
    results: dict[str, Any] = {"threads": n_threads()}
    for name, (is_bf16, environment) in variants.items():
        progress(name)
        # A process of its own: the allocator reads its settings once. `arena train` keeps memory as the later variants do.
        results[name] = _measure_apart(name, f"measure({is_bf16}, {MATCHES}, {MULTIPLIED}, {BATCH}, {RUNS})", environment)
    results["ppo_on_one_core"] = {}
    for channels, blocks in TRUNKS:
        name = f"ppo {channels} x {blocks}"
        progress(name)
        call = f"measure_ppo({channels}, {blocks}, {MULTIPLIED}, {GAMES}, {HORIZON}, {RUNS})"
        results["ppo_on_one_core"][f"{channels} x {blocks}"] = _measure_apart(name, call, KEEP)
    return results


def _measure_apart(name: str, call: str, environment: dict[str, str]) -> dict[str, float]:
    """Return what a call of a function of this module returns in a process of its own."""
    code = f"import json; from benchmarks import train; print(json.dumps(train.{call}))"
    bare = {key: value for key, value in os.environ.items() if key not in KEEP}
    done = subprocess.run([sys.executable, "-c", code], env={**bare, **environment}, capture_output=True, text=True, check=False)
    if done.returncode:
        what = (done.stderr.strip().splitlines() or [f"it ended with exit code {done.returncode}"])[-1]
        raise ArenaError(f"the measurement of {name} failed: {what}")
    figures: dict[str, float] = json.loads(done.stdout)
    return figures


def n_threads() -> int:
    """Return how many threads torch is given here: as OMP_NUM_THREADS says, or one per core."""
    given = os.environ.get("OMP_NUM_THREADS", "")
    return int(given) if given.isdigit() and int(given) else os.cpu_count() or 1


def measure(is_bf16: bool, n_matches: int, multiplied: int, batch: int, runs: int) -> dict[str, float]:
    """Return the figures of one kind of numbers, in this process."""
    torch.set_num_threads(n_threads())
    roof = roof_of(torch.bfloat16 if is_bf16 else torch.float32, multiplied, runs)
    ceiling = roof / (_PASSES * flops_per_view())
    trained = median_rate(trainer(is_bf16, batch), runs)
    shares, rates = zip(*(loop(is_bf16, n_matches, batch) for _ in range(runs)), strict=True)
    return {
        "roof_gflops": round(roof / 1e9, 1), "roof_samples_per_s": round(ceiling), "backprop_samples_per_s": round(trained),
        "backprop_of_roof": round(trained / ceiling, 3), "loop_samples_per_s": round(median(rates)),
        "loop_network_share": round(median(shares), 3),
    }  # fmt: skip


def measure_ppo(channels: int, blocks: int, multiplied: int, games: int, horizon: int, runs: int) -> dict[str, float]:
    """Return the figures of PPO's loop with one trunk, in this process, in the numbers that training computes in here."""
    torch.set_num_threads(1)
    roof = roof_of(precision_of("cpu"), multiplied, runs)
    return ppo_loop.measure_ppo(channels, blocks, roof, games=games, horizon=horizon, runs=runs)


def roof_of(kind: torch.dtype, size: int, runs: int) -> float:
    """Return what the cores multiply and add in a large matrix product, in floating-point operations a second."""
    one = torch.randn(size, size).to(kind)

    def work() -> int:
        torch.mm(one, one)
        return 2 * size**3

    return median_rate(work, runs)


def flops_per_view(window: int = 20) -> int:
    """Return the multiplications and additions of one forward pass of Table 5."""
    first, second = window - 4, window - 6
    return 2 * (first**2 * 25 * 32 + second**2 * 32 * 9 * 32 + 32 * second**2 * 400 + 400 * 5)


def learner_of(is_bf16: bool, batch: int) -> Reinforcer:
    """Return a fresh learner of the paper's size."""
    torch.manual_seed(0)
    return Reinforcer(PaperTeam(), ReinforceSettings(bf16=is_bf16, batch=batch), Processes())


def trainer(is_bf16: bool, size: int) -> Callable[[], int]:
    """Return work that trains on a batch of the replay, and returns its samples."""
    learner, rng = learner_of(is_bf16, size), np.random.default_rng(0)
    learner.replay.add(_stage(learner, 4).play_round(learner.to_act(), 0)[0])
    batch: Samples = learner.replay.draw(size, rng)

    def work() -> int:
        learner.backward(batch)
        learner.optimiser.step()
        return size

    return work


def loop(is_bf16: bool, n_matches: int, size: int) -> tuple[float, float]:
    """Play a round and train on as many samples as it gave; return the network's share of the time, and samples per second."""
    learner, rng = learner_of(is_bf16, size), np.random.default_rng(0)
    stage = _stage(learner, n_matches)
    stage.play_round(learner.to_act(), 0)  # compiles and warms up
    begin = time.perf_counter()
    clock = Clock(learner.to_act())
    samples, _ = stage.play_round(clock, 1)
    learner.replay.add(samples)
    n_batches = max(len(samples.unit) // size, 1)
    computing_s = clock.seconds
    for _ in range(n_batches):
        batch = learner.replay.draw(size, rng)
        before_s = time.perf_counter()
        learner.backward(batch)
        learner.optimiser.step()
        computing_s += time.perf_counter() - before_s
    took_s = time.perf_counter() - begin
    return computing_s / took_s, len(samples.unit) / took_s


def _stage(learner: Reinforcer, n_matches: int) -> RoundPlayer:
    """Return rows of the first experiment: nobody but the learner thinks in it."""
    return RoundPlayer(BatchedEnv(load_rules("exp1"), n_matches, seed=1), None, learner.settings)
