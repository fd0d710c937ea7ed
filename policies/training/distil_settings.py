"""The settings of a run that learns from demonstrations, written into the run's folder and never changed."""

import math
from dataclasses import dataclass

from policies.training.sample_settings import SampleSettings
from policies.training.settings import check_range


@dataclass(frozen=True, slots=True, kw_only=True)
class DistilSettings(SampleSettings):
    """Every number of a run that learns from demonstrations."""

    channels: int = 48
    blocks: int = 3
    passes: float = 3.0
    minibatch: int = 1024
    rate: float = 1e-3
    average: float = 0.99
    soft: float = 0.5
    """Share of the teacher's chances in what is learned; the rest is what it ordered."""
    value: float = 0.2
    """Weight of the error in foretelling the match's end, an auxiliary task."""
    belief: float = 0.05
    """Weight of the error in telling where the enemy's units are, seen or not, an auxiliary task."""

    def __post_init__(self) -> None:
        self.check("distil", "demonstrations", "arena train demonstrate")
        check_range(self, "soft", 0, 1)
        for name in ("value", "belief"):
            check_range(self, name, 0, math.inf, below=True)
