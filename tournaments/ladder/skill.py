"""Ratings that move with every match: OpenSkill, after Plackett and Luce, with draws. An estimate, and how unsure it is."""

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


def rate(entries: Mapping[Team, LadderEntry], result: MatchResult) -> dict[Team, LadderEntry]:
    """Return two entries after a match between them; a forfeit is a loss, and a void match is not to be rated."""
    if result.ending is Termination.VOID:
        raise ValueError("a void match says nothing of who played it")
    model = _model()
    ratings = [[model.rating(mu=entries[team].mu, sigma=entries[team].sigma)] for team in Team]
    ranks = [1.0 if result.winner in (team, None) else 2.0 for team in Team]
    rated = model.rate(ratings, ranks=ranks)
    return {
        team: _count(entries[team], team, result, mu=after.mu, sigma=after.sigma)
        for team, [after] in zip(Team, rated, strict=True)
    }


def _count(entry: LadderEntry, team: Team, result: MatchResult, *, mu: float, sigma: float) -> LadderEntry:
    has_lost = result.winner is team.other
    return replace(
        entry,
        mu=mu,
        sigma=sigma,
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
