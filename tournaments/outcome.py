"""What a venue tells of a match that ended: all that a league keeps, and nothing that depends on where it was played."""

from dataclasses import dataclass, field

from arena.game.types import Ending, Team


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatOutcome:
    """One side of a match."""

    faults: dict[str, int] = field(default_factory=dict)
    """What was counted against it, by kind: late, unreadable, stale, garbled, vanished, raised."""
    latency_p50_s: float | None = None
    """None where no network lay between."""
    latency_p99_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A match that ended."""

    identity: str
    blue: str
    red: str
    ending: Ending
    winner: Team | None
    score: int
    """Blue's."""
    ticks: int
    reason: str
    seats: dict[Team, SeatOutcome]
