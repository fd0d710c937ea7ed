"""The game as an environment for learning: PettingZoo's face, Gymnasium's, its vector form, and Stable-Baselines3's.

All of them play through `arena.game.engine.BatchedGame`, as the referee and the local venue do. `policies.environments` registers
them with Gymnasium, our fighters as opponents by name. The names below are handed on when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from arena.extras import needs

if TYPE_CHECKING:
    from arena.envs.parallel import ParallelCapture as ParallelCapture
    from arena.envs.parallel import parallel_env as parallel_env
    from arena.envs.sb3 import CaptureVecEnv as CaptureVecEnv
    from arena.envs.single import SingleCapture as SingleCapture
    from arena.envs.vector import VectorCapture as VectorCapture
    from arena.envs.views import as_observation as as_observation
    from arena.envs.views import as_observations as as_observations
    from arena.envs.views import as_orders as as_orders

_HOMES = {
    "CaptureVecEnv": "arena.envs.sb3",
    "ParallelCapture": "arena.envs.parallel",
    "parallel_env": "arena.envs.parallel",
    "SingleCapture": "arena.envs.single",
    "VectorCapture": "arena.envs.vector",
    "as_observation": "arena.envs.views",
    "as_observations": "arena.envs.views",
    "as_orders": "arena.envs.views",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'arena.envs' has no attribute {name!r}")
    with needs("sb3" if name == "CaptureVecEnv" else "envs", f"arena.envs.{name}"):
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
