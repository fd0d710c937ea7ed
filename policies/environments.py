"""The Gymnasium environments with our fighters as opponents, by name.

Importing this module registers them: `gymnasium.make("policies.environments:arena/CaptureTheFlag-v0")` does both.
"""

from typing import TYPE_CHECKING, Any

from arena.extras import needs
from arena.policy import BatchFactory
from policies.registry import load

with needs("envs", "policies.environments"):
    from gymnasium.envs.registration import register

    from arena.envs.single import SingleCapture
    from arena.envs.vector import VectorCapture

if TYPE_CHECKING:
    from arena.envs.sb3 import CaptureVecEnv

register(
    id="arena/CaptureTheFlag-v0",
    entry_point="policies.environments:make_single",
    vector_entry_point="policies.environments:make_vector",
)


def make_single(opponent: str | BatchFactory = "patrol", **options: Any) -> SingleCapture:
    """Return `SingleCapture` against a fighter's name or file, as `arena play` takes them, or a `BatchPolicy`."""
    return SingleCapture(_find(opponent), **options)


def make_vector(num_envs: int = 1, opponent: str | BatchFactory = "patrol", **options: Any) -> VectorCapture:
    """Return `VectorCapture`, likewise."""
    return VectorCapture(num_envs, _find(opponent), **options)


def make_sb3(num_envs: int = 1, opponent: str | BatchFactory = "patrol", **options: Any) -> "CaptureVecEnv":
    """Return the vector form as a `VecEnv` of Stable-Baselines3, likewise."""
    with needs("sb3", "make_sb3"):
        from arena.envs.sb3 import CaptureVecEnv

    return CaptureVecEnv(make_vector(num_envs, opponent, autoreset_mode="SameStep", **options))


def _find(opponent: str | BatchFactory) -> BatchFactory:
    return load(opponent) if isinstance(opponent, str) else opponent
