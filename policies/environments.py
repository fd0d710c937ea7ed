"""The Gymnasium environments with our fighters as opponents, by name.

Importing this module registers them: `gymnasium.make("policies.environments:arena/CaptureTheFlag-v0")` does both.
"""

from typing import Any

from arena.extras import needs
from arena.policy import BatchFactory
from policies.registry import load

with needs("envs", "policies.environments"):
    from gymnasium.envs.registration import register

    from arena.envs.single import SingleCapture
    from arena.envs.vector import VectorCapture

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


def _find(opponent: str | BatchFactory) -> BatchFactory:
    return load(opponent) if isinstance(opponent, str) else opponent
