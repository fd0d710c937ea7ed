"""The settings of a run that learns what plans are worth, written into the run's folder and never changed."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from arena.game.ruleset import parse_overrides
from policies.training.sample_settings import check_samples
from policies.training.settings import check_range, read_values


@dataclass(frozen=True, slots=True, kw_only=True)
class AppraiseSettings:
    """Every number of a run that learns from trials. Samples are ticks of one seat."""

    seed: int = 1
    rules: str = "paper"
    data: list[str] = field(default_factory=list)
    """Folders of trials."""
    channels: int = 24
    blocks: int = 2
    passes: float = 2.0
    """How often each sample is learned from."""
    minibatch: int = 512
    """Samples of one step, over all processes."""
    rate: float = 1.5e-3
    """Learning rate at the start; it falls to a hundredth, along a cosine."""
    spread: float = 4.0
    """Weight of the error in how plans differ, beside that in the mean of all that were tried."""
    average: float = 0.995
    """Decay of the running average of the weights that is saved, per step of the optimiser."""

    def __post_init__(self) -> None:
        check_samples(self, "appraise", "trials", "arena train try-plans")
        check_range(self, "spread", 0, math.inf, below=True)

    def with_(self, assignments: Iterable[str]) -> "AppraiseSettings":
        """Return a copy with values such as "passes=5" replaced."""
        return from_dict({**asdict(self), **parse_overrides(assignments)})


def from_dict(values: dict[str, Any]) -> AppraiseSettings:
    """Return settings from what a run's folder holds, or a user wrote; an unknown or ill-typed value is an `InputError`."""
    return read_values(AppraiseSettings, values)
