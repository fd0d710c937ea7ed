"""The settings of a run that learns from demonstrations, written into the run's folder and never changed."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from arena.game.ruleset import parse_overrides
from policies.training.sample_settings import check_samples
from policies.training.settings import check_range, read_values


@dataclass(frozen=True, slots=True, kw_only=True)
class DistilSettings:
    """Every number of a run that learns from demonstrations. Samples are ticks of one seat."""

    seed: int = 1
    rules: str = "paper"
    data: list[str] = field(default_factory=list)
    """Folders of demonstrations."""
    channels: int = 48
    blocks: int = 3
    passes: float = 3.0
    """How often each sample is learned from."""
    minibatch: int = 1024
    """Samples of one step, over all processes."""
    rate: float = 1e-3
    """Learning rate at the start; it falls to a hundredth, along a cosine."""
    soft: float = 0.5
    """Share of the teacher's chances in what is learned; the rest is what it ordered."""
    value: float = 0.2
    """Weight of the error in foretelling the match's end, an auxiliary task."""
    belief: float = 0.05
    """Weight of the error in telling where the enemy's units are, seen or not, an auxiliary task."""
    average: float = 0.99
    """Decay of the running average of the weights that is saved, per step of the optimiser."""

    def __post_init__(self) -> None:
        check_samples(self, "distil", "demonstrations", "arena train demonstrate")
        check_range(self, "soft", 0, 1)
        for name in ("value", "belief"):
            check_range(self, name, 0, math.inf, below=True)

    def with_(self, assignments: Iterable[str]) -> "DistilSettings":
        """Return a copy with values such as "passes=5" replaced."""
        return from_dict({**asdict(self), **parse_overrides(assignments)})


def from_dict(values: dict[str, Any]) -> DistilSettings:
    """Return settings from what a run's folder holds, or a user wrote; an unknown or ill-typed value is an `InputError`."""
    return read_values(DistilSettings, values)
