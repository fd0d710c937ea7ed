"""How a network plays: what becomes of its chances before an action is drawn."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.errors import PolicyError
from policies.networks.models import NEVER
from policies.settings import read_settings

MOST_TEMPERATURE = 100.0
"""Beyond it, what is not legal would get a chance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaySettings:
    """What a checkpoint's manifest says about how it is to be played.

    Raises
    ------
    PolicyError
        A value is none.
    """

    temperature: float = 1.0
    """What log-probabilities are divided by before an action is drawn; at 0 it is the likeliest."""
    mirror: bool = False
    """Whether log-probabilities are the mean of those on the board and of those on its north-south mirror image."""

    def __post_init__(self) -> None:
        if type(self.mirror) is not bool:
            raise PolicyError(f"the setting mirror is {self.mirror!r}; it must be true or false")
        if type(self.temperature) not in (int, float) or not 0 <= self.temperature <= MOST_TEMPERATURE:
            raise PolicyError(f"the temperature is {self.temperature!r}; it must be a number from 0 to {MOST_TEMPERATURE:g}")

    def with_(self, name: str, text: str) -> "PlaySettings":
        """Return a copy with what stands behind the name of a fighter, as in "temperature=0,mirror=true".

        Raises
        ------
        PolicyError
            There is no such setting, or no such value of it.
        """
        changed: dict[str, Any] = {**asdict(self), **read_settings(name, text, asdict(PlaySettings()))}
        return PlaySettings(**changed)


def at_temperature(logits: NDArray[np.float32], temperature: float) -> NDArray[np.float32]:
    """Return the logits to draw from at a temperature, of the same shape."""
    if temperature == 1:
        return logits
    if temperature == 0:
        return np.where(logits == logits.max(-1, keepdims=True), 0.0, NEVER).astype(np.float32)
    return logits / np.float32(temperature)


def mean_of_logs(one: NDArray[np.float32], other: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return logits whose log-probabilities are the mean of those of two; all of shape (..., actions)."""
    mean: NDArray[np.float32] = np.float32(0.5) * (_log_softmax(one) + _log_softmax(other))
    return mean


def _log_softmax(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    shifted = logits - logits.max(-1, keepdims=True)
    logs: NDArray[np.float32] = shifted - np.log(np.exp(shifted).sum(-1, keepdims=True))
    return logs
