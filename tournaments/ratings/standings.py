"""From results to the facts of a report: who stands where, who failed how, and whether a side was favoured.

Everything here follows from the stored results alone, whatever their order; what a clock measured stands apart (`Latency`).
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from arena.game.types import Team, Termination
from arena.intervals import margin_of
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.methods import RatingMethod
from tournaments.ratings.rate import N_DRAWS, Follows, Rating, rate
from tournaments.ratings.residuals import Cycle, Residual, find_cycles, find_residuals
from tournaments.ratings.shares import Share, ShareMethod, share

FAULTS = ("late", "unreadable", "stale", "garbled", "vanished", "raised")
"""What is counted against an entry, in the order of the report's columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """How long an entry took to answer."""

    p50_s: float
    """Median over matches of the match's median."""
    p99_s: float
    """Of its worst match."""


@dataclass(slots=True, kw_only=True)
class Record:
    """Wins, draws and losses, of an entry or of one entry against another."""

    wins: int = 0
    draws: int = 0
    losses: int = 0

    @property
    def n_matches(self) -> int:
        """Matches played."""
        return self.wins + self.draws + self.losses

    @property
    def score(self) -> float | None:
        """Points per match: 1 for a win, 0.5 for a draw; None without a match."""
        return (self.wins + self.draws / 2) / self.n_matches if self.n_matches else None

    def add(self, points: float) -> None:
        """Count a match."""
        if points == 1:
            self.wins += 1
        elif points == 0:
            self.losses += 1
        else:
            self.draws += 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One row of the leaderboard."""

    name: str
    rating: Rating
    record: Record
    faults: Mapping[str, int]
    forfeits: int
    latency: Latency | None
    shares: Mapping[str, Share] = field(default_factory=dict)
    """By the methods that were asked for."""

    @property
    def rank_range(self) -> str:
        """Its rank as what is known of it, as in `2 to 4`."""
        low, high = self.rating.rank_low, self.rating.rank_high
        return f"{low}" if low == high else f"{low} to {high}"


@dataclass(frozen=True, slots=True, kw_only=True)
class SideBias:
    """What playing blue was worth."""

    blue_wins: int
    draws: int
    red_wins: int
    bias: float
    """Blue's points less red's, per match: 0 is fair, 1 is blue wins all."""
    bias_low: float
    """Lower end of the 95% interval of `bias`, over pairs."""
    bias_high: float
    elo: float
    """The same, as the ratings see it: entries are of different strength."""
    elo_low: float
    elo_high: float

    @property
    def is_significant(self) -> bool:
        """Whether the interval excludes 0."""
        return self.bias_low > 0 or self.bias_high < 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Standings:
    """A league's table."""

    rows: tuple[Standing, ...]
    """The best first."""
    cross: Mapping[tuple[str, str], Record]
    """Of one entry against another, as the first sees it; both ways."""
    superiority: Mapping[tuple[str, str], float]
    """How likely the first is to be the stronger; both ways."""
    residuals: tuple[Residual, ...]
    """Every fixture beside what the ratings expect of it, the most surprising first."""
    cycles: tuple[Cycle, ...]
    side: SideBias
    draw_rate: float | None
    """Share of draws between equals, as the ratings see it."""
    endings: Mapping[str, int]
    n_matches: int
    n_ticks: int


@dataclass(slots=True)
class _Seen:
    """What is gathered of one entry."""

    record: Record = field(default_factory=Record)
    faults: Counter[str] = field(default_factory=Counter)
    forfeits: int = 0
    p50s_s: list[float] = field(default_factory=list)
    p99s_s: list[float] = field(default_factory=list)


def stand(
    names: Iterable[str],
    outcomes: Iterable[Outcome],
    *,
    are_maps_fresh: bool = False,
    n_draws: int = N_DRAWS,
    method: RatingMethod = rate,
    follows: Follows = (),
    share_methods: Mapping[str, ShareMethod] | None = None,
) -> Standings:
    """Return the table of a league.

    Parameters
    ----------
    names
        Every entry, with matches or without.
    outcomes
        What was played; void matches are none.
    are_maps_fresh
        Whether no map came twice; see `rate`.
    follows
        Names of consecutive versions of an entry, the earlier first.
    share_methods
        What else each entry is given, by name.
    """
    names, outcomes = list(names), list(outcomes)
    seen = {name: _Seen() for name in names}
    cross: defaultdict[tuple[str, str], Record] = defaultdict(Record)
    for outcome in outcomes:
        for team, own, other in ((Team.BLUE, outcome.blue, outcome.red), (Team.RED, outcome.red, outcome.blue)):
            points = outcome.result.points(team)
            entry, seat = seen[own], outcome.seats[team]
            entry.record.add(points)
            cross[own, other].add(points)
            entry.faults.update(seat.faults)
            entry.forfeits += outcome.result.ending is Termination.FORFEIT and points == 0
            if seat.latency_p50_s is not None:
                entry.p50s_s.append(seat.latency_p50_s)
            if seat.latency_p99_s is not None:
                entry.p99s_s.append(seat.latency_p99_s)
    versions = {"follows": follows} if follows else {}  # a method of others need not know of versions until there are any
    ratings = method(names, outcomes, are_maps_fresh=are_maps_fresh, n_draws=n_draws, **versions)
    shares = {what: share(names, outcomes, each) for what, each in (share_methods or {}).items()}
    rows = [
        Standing(
            name=name,
            rating=ratings.entries[name],
            record=entry.record,
            faults={kind: entry.faults[kind] for kind in (*FAULTS, *sorted(set(entry.faults) - set(FAULTS)))},
            forfeits=entry.forfeits,
            latency=Latency(p50_s=median(entry.p50s_s), p99_s=max(entry.p99s_s)) if entry.p50s_s and entry.p99s_s else None,
            shares={what: of[name] for what, of in shares.items()},
        )
        for name, entry in seen.items()
    ]
    counts = Counter(outcome.result.ending for outcome in outcomes)
    bias, low, high = _side_bias(outcomes)
    sides = Counter(outcome.result.winner for outcome in outcomes)
    return Standings(
        rows=tuple(sorted(rows, key=lambda row: (row.rating.rank, row.name))),
        cross=dict(cross),
        superiority=ratings.superiority,
        residuals=find_residuals(ratings, outcomes),
        cycles=find_cycles(outcomes),
        side=SideBias(
            blue_wins=sides[Team.BLUE], draws=sides[None], red_wins=sides[Team.RED], bias=bias, bias_low=low, bias_high=high,
            elo=ratings.side_elo, elo_low=ratings.side_elo_low, elo_high=ratings.side_elo_high,
        ),
        draw_rate=ratings.draw_rate,
        endings={ending.name.lower(): counts[ending] for ending in Termination if counts[ending]},
        n_matches=len(outcomes),
        n_ticks=sum(outcome.result.ticks for outcome in outcomes),
    )  # fmt: skip


def _side_bias(outcomes: Iterable[Outcome]) -> tuple[float, float, float]:
    """Return blue's points less red's per match, with a 95% interval over whole pairs; the widest there is without two pairs."""
    pairs: defaultdict[str, list[float]] = defaultdict(list)
    for outcome in outcomes:
        pairs[LeagueMatchId.parse(outcome.identity).pair_id].append(2 * outcome.result.points(Team.BLUE) - 1)
    leads = np.array([np.mean(games) for _, games in sorted(pairs.items()) if len(games) == 2])
    bias, margin = (float(leads.mean()) if len(leads) else 0.0), margin_of(leads, reach=2.0)
    if margin is None:
        return bias, -1.0, 1.0
    return bias, max(bias - margin, -1.0), min(bias + margin, 1.0)
