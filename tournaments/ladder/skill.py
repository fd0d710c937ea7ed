"""Ratings that move with every match: OpenSkill, after Plackett and Luce, with draws. An estimate, and how unsure it is.

What is known of an entry grows old: with the days that pass, up to a bound, and at once with a new version of its code.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from arena.game.types import Team, Termination
from arena.policy import MatchResult

if TYPE_CHECKING:
    from openskill.models import PlackettLuce

START_MU, START_SIGMA = 25.0, 25.0 / 3.0
"""Of whoever has not played; OpenSkill's own."""
ELO = 30.0
"""Of one point of `mu`, nearly."""
DRIFT_PER_DAY = (50 / ELO) ** 2 / 90
"""Variance that a day adds: in a quarter of a year, a standard deviation of 50 Elo."""
MOST_DRIFTED = 100 / ELO
"""Standard deviation that days alone do not raise: a bot that nobody touched is not a stranger because it stayed away."""
NEW_VERSION = 150 / ELO
"""Standard deviation that a new version adds."""
_DAY_S = 86_400.0
SURE = 3.0
"""A rating is `mu` less so many `sigma`: who has played little stands low, and climbs as it becomes known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderEntry:
    """An entry of a ladder, after the matches that it has played there."""

    key: str
    """Public key, as text."""
    name: str
    """Under which it played last."""
    mu: float = START_MU
    sigma: float = START_SIGMA
    wins: int = 0
    draws: int = 0
    losses: int = 0
    """Forfeits included."""
    forfeits: int = 0
    n_blue: int = 0
    """Matches that it played as blue."""
    version: str = ""
    """Of its code, as its clients said last; empty if they never did."""
    played_at: float = 0.0
    """When its last match was rated, in seconds since 1970; 0 if that is not known."""

    @property
    def n_matches(self) -> int:
        """Matches that were rated."""
        return self.wins + self.draws + self.losses

    @property
    def rating(self) -> float:
        """What it is ranked by."""
        return self.mu - SURE * self.sigma


@cache
def _model() -> "PlackettLuce":
    from openskill.models import PlackettLuce

    return PlackettLuce(mu=START_MU, sigma=START_SIGMA)


def age(entry: LadderEntry, now_s: float) -> LadderEntry:
    """Return an entry as it is known at a time, in seconds since 1970: the less surely, the longer it has not played."""
    days = max(now_s - entry.played_at, 0.0) / _DAY_S if entry.played_at else 0.0
    drifted = (entry.sigma**2 + DRIFT_PER_DAY * days) ** 0.5
    return replace(entry, sigma=max(entry.sigma, min(drifted, MOST_DRIFTED)))


def renew(entry: LadderEntry, version: str) -> LadderEntry:
    """Return an entry that plays by a version of its code; one that does not say which plays by the one that it had."""
    if not version or version == entry.version:
        return entry
    renewed = min((entry.sigma**2 + NEW_VERSION**2) ** 0.5, START_SIGMA) if entry.version else entry.sigma
    return replace(entry, version=version, sigma=max(entry.sigma, renewed))


def rate(entries: Mapping[Team, LadderEntry], result: MatchResult, now_s: float = 0.0) -> dict[Team, LadderEntry]:
    """Return two entries after a match between them at a time; a forfeit is a loss, and a void match is not to be rated."""
    if result.ending is Termination.VOID:
        raise ValueError("a void match says nothing of who played it")
    model = _model()
    entries = {team: age(entry, now_s) for team, entry in entries.items()}
    ratings = [[model.rating(mu=entries[team].mu, sigma=entries[team].sigma)] for team in Team]
    ranks = [1.0 if result.winner in (team, None) else 2.0 for team in Team]
    rated = model.rate(ratings, ranks=ranks)
    return {
        team: _count(replace(entries[team], mu=after.mu, sigma=after.sigma, played_at=now_s), team, result)
        for team, [after] in zip(Team, rated, strict=True)
    }


def _count(entry: LadderEntry, team: Team, result: MatchResult) -> LadderEntry:
    has_lost = result.winner is team.other
    return replace(
        entry,
        wins=entry.wins + (result.winner is team),
        draws=entry.draws + (result.winner is None),
        losses=entry.losses + has_lost,
        forfeits=entry.forfeits + (has_lost and result.ending is Termination.FORFEIT),
        n_blue=entry.n_blue + (team is Team.BLUE),
    )


def rank(entries: list[LadderEntry]) -> list[dict[str, Any]]:
    """Return the standings, the best first, as `arena.protocol.messages.Lobby` has them."""
    ordered = sorted(entries, key=lambda entry: (-entry.rating, entry.name, entry.key))
    return [
        {
            "name": entry.name,
            "rating": round(entry.rating, 3),
            "mu": round(entry.mu, 3),
            "sigma": round(entry.sigma, 3),
            "wins": entry.wins,
            "draws": entry.draws,
            "losses": entry.losses,
            "forfeits": entry.forfeits,
        }
        for entry in ordered
    ]
