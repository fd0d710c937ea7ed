"""The vector form for Stable-Baselines3, which takes vector environments of its own kind alone."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from arena.envs.vector import VectorCapture
from arena.envs.views import Shown
from arena.errors import InputError

Indices = int | Iterable[int] | None


class CaptureVecEnv(VecEnv):  # type: ignore[misc]  # mypy is not shown the package, which need not be installed
    """`VectorCapture` as a `VecEnv` of Stable-Baselines3.

    Parameters
    ----------
    env
        With `AutoresetMode.SAME_STEP`, as Stable-Baselines3 has it.
    """

    def __init__(self, env: VectorCapture) -> None:
        if env.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise InputError('Stable-Baselines3 begins a match anew in the same step: make the environment with "SameStep"')
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions: Any = None

    def reset(self) -> Shown:
        """Begin a match in every row, under the seeds of `seed` if it was called."""
        observations, infos = self.env.reset(seed=list(self._seeds))
        self.reset_infos = [{"ending": ending} for ending in infos["ending"].tolist()]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of `step_wait`, shape (num_envs, units)."""
        self._actions = actions

    def step_wait(self) -> tuple[Shown, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Play one tick; where a match ends, its info has the `terminal_observation`, and the next one begins."""
        observations, rewards, is_over, _, infos = self.env.step(self._actions)
        last = infos.get("final_info", infos)["ending"]
        split = [{"ending": ending, "TimeLimit.truncated": False} for ending in infos["ending"].tolist()]
        for row in np.flatnonzero(is_over):
            split[row] |= {"ending": int(last[row]), "terminal_observation": infos["final_obs"][row]}
            self.reset_infos[row] = {"ending": int(infos["ending"][row])}
        return observations, rewards.astype(np.float32), is_over, split

    def close(self) -> None:
        """Nothing is held."""

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute of the environment, once for each row."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Raise `InputError`: the rows of a batch have no attributes of their own."""
        raise InputError(f"the rows of a batch have no attributes of their own, so {attr_name} cannot be set")

    def env_method(self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any) -> list[Any]:
        """Raise `InputError`: the rows of a batch have no methods of their own."""
        raise InputError(f"the rows of a batch have no methods of their own, so {method_name} cannot be called")

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Return that no row is wrapped."""
        return [False for _ in self._get_indices(indices)]
