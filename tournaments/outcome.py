"""What a venue tells of a match that ended: all that a league keeps, and nothing that depends on where it was played."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.records.journal import Header
from arena.records.plan import MatchPlan


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatOutcome:
    """One side of a match."""

    faults: dict[str, int] = field(default_factory=dict)
    """What was counted against it, by kind: late, unreadable, stale, garbled, forged, vanished; what never happened is left out.

    `late` and `unreadable` are of the whole match, whatever was killed in it: its journal holds them. The others, and the
    latencies, are of the part that the referee who ended the match was alive in.
    """
    latency_p50_s: float | None = None
    """Median of its answers; None where no network lay between, or where the result was read from the journal."""
    latency_p99_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A match that ended."""

    identity: str
    blue: str
    red: str
    ending: Termination
    winner: Team | None
    score: int
    """Blue's."""
    ticks: int
    reason: str
    seats: dict[Team, SeatOutcome]

    @classmethod
    def of(cls, match: Header | MatchPlan, result: MatchResult, seats: Mapping[Team, SeatOutcome]) -> "Outcome":
        """Return how a match ended; `result.score` is blue's."""
        return cls(
            identity=match.identity,
            blue=match.blue,
            red=match.red,
            ending=result.ending,
            winner=result.winner,
            score=result.score,
            ticks=result.ticks,
            reason=result.reason,
            seats=dict(seats),
        )
