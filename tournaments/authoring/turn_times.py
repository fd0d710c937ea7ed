"""How long a bot takes for its turns."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median, quantiles


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnTimes:
    """How long turns took, in milliseconds."""

    median_ms: float
    p99_ms: float
    worst_ms: float

    @classmethod
    def of(cls, took_s: Sequence[float]) -> "TurnTimes":
        """Return what some turns took; there is at least one."""
        took_ms = [1000 * one for one in took_s]
        p99_ms = quantiles(took_ms, n=100, method="inclusive")[98] if len(took_ms) > 1 else took_ms[0]
        return cls(median_ms=median(took_ms), p99_ms=p99_ms, worst_ms=max(took_ms))
