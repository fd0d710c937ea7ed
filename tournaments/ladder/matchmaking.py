"""Who is to meet whom on a ladder. Pure: ratings, waits and the time go in.

Two meet when their ratings are near; how near, widens as they wait, without a bound. Whoever has waited longest chooses first. So
nobody waits for ever while somebody else is free.
"""

from collections.abc import Sequence
from dataclasses import dataclass

NEAR = 4.0
"""Difference of two ratings that is no reason to wait: about what an OpenSkill rating takes for a 3 to 1 chance."""
WIDEN_PER_S = 4.0
"""The widest difference there is, of about 40, is accepted after some ten seconds."""
AGAIN = 6.0
"""A rematch waits as if the ratings were so much further apart: time for somebody else to turn up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """An entry that waits, as far as it matters for whom it meets."""

    mu: float
    since_s: float
    last: int | None = None
    """Index among the candidates of the one that it met last, if that waits too."""


def choose(candidates: Sequence[Candidate], now_s: float) -> tuple[int, int] | None:
    """Return the indices of two that are to meet now, who has waited longer first; None if nobody's time has come.

    The same two do not meet twice in a row, except where neither has another opponent to wait for.
    """
    by_wait = sorted(range(len(candidates)), key=lambda index: candidates[index].since_s)
    for index in by_wait:
        one = candidates[index]
        accepted = NEAR + WIDEN_PER_S * (now_s - one.since_s)
        others = [other for other in by_wait if other != index and _may_meet(candidates, index, other)]
        nearest = min(others, key=lambda other: _distance(candidates, index, other), default=None)
        if nearest is not None and _distance(candidates, index, nearest) <= accepted:
            return index, nearest
    return None


def _met_last(candidates: Sequence[Candidate], one: int, other: int) -> bool:
    return candidates[one].last == other or candidates[other].last == one


def _may_meet(candidates: Sequence[Candidate], one: int, other: int) -> bool:
    """Whether it is no rematch, or the only match that either could have."""
    if not _met_last(candidates, one, other):
        return True
    rest = [index for index in range(len(candidates)) if index not in (one, other)]
    return all(_met_last(candidates, mine, index) for mine in (one, other) for index in rest)


def _distance(candidates: Sequence[Candidate], one: int, other: int) -> float:
    return abs(candidates[one].mu - candidates[other].mu) + AGAIN * _met_last(candidates, one, other)
