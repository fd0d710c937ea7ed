"""The best and the worst opponents of each entry: by points, and by what the ratings do not expect."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tournaments.ratings.standings import Standings
from tournaments.reports.leaderboard import rounded


@dataclass(frozen=True, slots=True, kw_only=True)
class Opponent:
    """Another entry, as one sees it."""

    name: str
    n_matches: int
    score: float
    """Points per match against it."""
    expected: float | None = None
    """The same by the ratings; None where a method of ratings expects none."""
    z: float = 0.0
    """Standard errors between the two."""
    is_significant: bool = False

    @property
    def by_points(self) -> str:
        """Name and score, in words."""
        return f"{self.name} {self.score:.3f}"

    @property
    def by_rating(self) -> str:
        """Name, score, and in brackets what was expected."""
        return self.by_points if self.expected is None else f"{self.by_points} ({self.expected:.3f})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Opponents:
    """Those that stand out; the best and the worst may be the same where there are few."""

    best: Opponent
    """Against whom it scores most."""
    worst: Opponent
    most_above: Opponent | None
    """Against whom it scores most above what the ratings expect, in standard errors; None if against nobody."""
    most_below: Opponent | None


def find_opponents(standings: Standings) -> dict[str, Opponents]:
    """Return the opponents of each entry that met two or more, in the order of the table."""
    met: defaultdict[str, dict[str, Opponent]] = defaultdict(dict)
    for (one, other), record in standings.cross.items():
        if record.score is not None:
            met[one][other] = Opponent(name=other, n_matches=record.n_matches, score=record.score)
    for residual in standings.residuals:
        one, other, expected, z = residual.one, residual.other, residual.expected, residual.z
        for own, against, points, off in ((one, other, expected, z), (other, one, 1 - expected, -z)):
            before = met[own][against]
            met[own][against] = Opponent(
                name=against,
                n_matches=before.n_matches,
                score=before.score,
                expected=points,
                z=off,
                is_significant=residual.is_significant,
            )
    found = {}
    for row in standings.rows:
        others = sorted(met[row.name].values(), key=lambda one: one.name)
        if len(others) > 1:
            above, below = max(others, key=lambda one: one.z), min(others, key=lambda one: one.z)
            found[row.name] = Opponents(
                best=max(others, key=lambda one: one.score),
                worst=min(others, key=lambda one: one.score),
                most_above=above if above.z > 0 else None,
                most_below=below if below.z < 0 else None,
            )
    return found


def opponents_to_dict(opponents: Mapping[str, Opponents]) -> dict[str, Any]:
    """Return the opponents of each entry as JSON holds them."""
    return {
        entry: {
            "best": _to_dict(found.best),
            "worst": _to_dict(found.worst),
            "most_above_rating": _to_dict(found.most_above),
            "most_below_rating": _to_dict(found.most_below),
        }
        for entry, found in opponents.items()
    }


def _to_dict(one: Opponent | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {
        "entry": one.name,
        "matches": one.n_matches,
        "score": rounded(one.score, 4),
        "expected": rounded(one.expected, 4),
        "z": rounded(one.z, 4),
        "significant": one.is_significant,
    }
