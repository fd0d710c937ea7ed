"""The settings of a run that learns what plans are worth, written into the run's folder and never changed."""

import math
from dataclasses import dataclass

from policies.training.sample_settings import SampleSettings
from policies.training.settings import check_range


@dataclass(frozen=True, slots=True, kw_only=True)
class AppraiseSettings(SampleSettings):
    """Every number of a run that learns from trials."""

    channels: int = 24
    blocks: int = 2
    passes: float = 2.0
    minibatch: int = 512
    rate: float = 1.5e-3
    average: float = 0.995
    spread: float = 4.0
    """Weight of the error in how plans differ, beside that in the mean of all that were tried."""

    def __post_init__(self) -> None:
        self.check("appraise", "trials", "arena train try-plans")
        check_range(self, "spread", 0, math.inf, below=True)
