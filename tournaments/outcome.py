"""How a match of a league ended: all that a league keeps of it, and nothing that depends on the venue."""

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
    result: MatchResult
    """`score` is blue's."""
    seats: Mapping[Team, SeatOutcome]

    @classmethod
    def of(cls, match: Header | MatchPlan, result: MatchResult, seats: Mapping[Team, SeatOutcome]) -> "Outcome":
        """Return the outcome of a match; `result.score` is blue's."""
        return cls(identity=match.identity, blue=match.blue, red=match.red, result=result, seats=seats)

    @classmethod
    def void(cls, plan: MatchPlan, reason: str) -> "Outcome":
        """Return the outcome of a match that was not played."""
        result = MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=0, reason=reason)
        return cls.of(plan, result, {team: SeatOutcome() for team in Team})

    @property
    def winner(self) -> str | None:
        """The entry that won; None in a draw."""
        return None if self.result.winner is None else (self.blue, self.red)[self.result.winner]

    @property
    def headline(self) -> str:
        """Who won and how, as in "rush wins by forfeit (red vanished)"."""
        return self.result.headline(self.blue, self.red)

    @property
    def log_facts(self) -> dict[str, object]:
        """What a log says of it once it is stored."""
        faults = {team.name.lower(): seat.faults for team, seat in self.seats.items()}
        who = {"identity": self.identity, "blue": self.blue, "red": self.red}
        return {"event": "match stored", **who, **self.result.to_dict(), "faults": faults}

    def points(self, entry: str) -> float:
        """Return what the match is worth to one of its two entries: 1 for a win, 0.5 for a draw, 0 for a loss."""
        return self.result.points(Team.BLUE if self.blue == entry else Team.RED)
