"""Who is to meet whom on a ladder. Pure: ratings, waits and the time go in.

Two meet when their ratings are not far apart; how far, widens as they wait, without a bound. Whoever has waited longest chooses
first. So nobody waits for ever while somebody else is free. Among those that are near enough it is the one that it has met least:
whoever meets its neighbours alone is rated by them alone, and intervals are too narrow then (`NEAR`).

Two of one owner never meet.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

NEAR = 15.0
"""Difference of two ratings that is no reason to wait: 450 Elo, 13 to 1. With 4.0, less than half of the 95% intervals of ten
simulated entries of like strength held the truth after 300 matches each; with this, nearly all do."""
WIDEN_PER_S = 4.0
"""The widest difference there is, of about 40, is accepted after some ten seconds."""
AGAIN = 21.0
"""A rematch waits as if the ratings were so much further apart: time for somebody else to turn up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """An entry that waits, as far as it matters for whom it meets."""

    mu: float
    since_s: float
    owner: str = ""
    """Whose it is; nobody's, if empty."""
    last: int | None = None
    """Index among the candidates of the one that it met last, if that waits too."""
    n_met: Mapping[int, int] = field(default_factory=dict)
    """How often it met lately which of the candidates, by index."""


def choose(candidates: Sequence[Candidate], now_s: float) -> tuple[int, int] | None:
    """Return the indices of two that are to meet now, who has waited longer first; None if nobody's time has come.

    The same two do not meet twice in a row, except where neither has another opponent to wait for.
    """
    by_wait = sorted(range(len(candidates)), key=lambda index: candidates[index].since_s)
    for index in by_wait:
        one = candidates[index]
        accepted = NEAR + WIDEN_PER_S * (now_s - one.since_s)
        others = [other for other in by_wait if _may_meet(candidates, index, other)]
        best = min(others, key=lambda other: _rank(candidates, index, other), default=None)
        if best is not None and _distance(candidates, index, best) <= accepted:
            return index, best
    return None


def _met_last(candidates: Sequence[Candidate], one: int, other: int) -> bool:
    return candidates[one].last == other or candidates[other].last == one


def _is_own(candidates: Sequence[Candidate], one: int, other: int) -> bool:
    return one == other or candidates[one].owner == candidates[other].owner != ""


def _may_meet(candidates: Sequence[Candidate], one: int, other: int) -> bool:
    """Whether they are of two owners, and it is no rematch, or the only match that either could have."""
    if _is_own(candidates, one, other):
        return False
    if not _met_last(candidates, one, other):
        return True
    rest = [index for index in range(len(candidates)) if index not in (one, other)]
    return all(_met_last(candidates, mine, index) or _is_own(candidates, mine, index) for mine in (one, other) for index in rest)


def _rank(candidates: Sequence[Candidate], one: int, other: int) -> tuple[float, int, float]:
    """Return what is smallest for the best opponent: the nearest, and of all that are near, the one that was met least."""
    distance = _distance(candidates, one, other)
    return max(distance, NEAR), candidates[one].n_met.get(other, 0), distance


def _distance(candidates: Sequence[Candidate], one: int, other: int) -> float:
    return abs(candidates[one].mu - candidates[other].mu) + AGAIN * _met_last(candidates, one, other)
