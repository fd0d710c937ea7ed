"""The learning environments: steps a second on one core, of random actions against `patrol` under the rules `paper`."""

from collections.abc import Callable
from typing import Any

import numpy as np

from arena.envs import parallel_env
from benchmarks.measuring.rates import Work, median_rate
from policies.environments import make_single, make_vector

N_ROWS = 256
_STEPS = 20
"""In one go."""


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Steps per second of each form; of the vector form, those of all its rows together."""
    works = {
        "single": _single(),
        "parallel_teams": _parallel("teams"),
        "parallel_units": _parallel("units"),
        f"vector_{N_ROWS}": _vector(),
    }
    rates = {}
    for name, work in works.items():
        progress(name)
        rates[f"{name}_steps_per_s"] = round(median_rate(work))
    return rates


def _single() -> Work:
    env, rng = make_single(), np.random.default_rng(0)
    env.reset(seed=1)

    def work() -> int:
        for actions in rng.integers(0, 5, (_STEPS, 6)):
            if env.step(actions)[2]:
                env.reset()
        return _STEPS

    return work


def _parallel(agents: str) -> Work:
    env, rng = parallel_env(agents=agents), np.random.default_rng(0)
    env.reset(seed=1)

    def work() -> int:
        for actions in rng.integers(0, 5, (_STEPS, 12)).tolist():
            if agents == "units":
                env.step({agent: actions[number] for number, agent in enumerate(env.agents)})
            else:
                env.step({"blue": actions[:6], "red": actions[6:]})
            if not env.agents:
                env.reset()
        return _STEPS

    return work


def _vector() -> Work:
    env, rng = make_vector(N_ROWS), np.random.default_rng(0)
    env.reset(seed=1)

    def work() -> int:
        env.step(rng.integers(0, 5, (N_ROWS, 6)))
        return N_ROWS

    return work
