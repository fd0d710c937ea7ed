"""A league of two that ends at the pair which decides whether one is better.

The decision follows from the pairs in their planned order alone: from the shortest row of pairs, the first one included, that
decides. In whatever order matches end, on whichever venue, and however often the league is stopped, that is the same pair.
Matches beyond it are stored, since they were played, and do not count: who looked at them too would stop where luck is good.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import takewhile
from typing import Any

from arena.records.plan import LeagueMatchId, MatchPlan
from tournaments.outcome import Outcome
from tournaments.ratings.sprt import Sprt, Verdict, pair_scores

LEAST_BATCH = 16
"""Pairs that are played between two looks at the test; the venue starts its processes anew for each."""
_GROWTH = 4
"""A batch is as long as this part of what was played before: looks stay few, and of all pairs at most this part is in vain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Duel:
    """A test of one entry against another, as far as its pairs have been played."""

    challenger: str
    """Who may be the better one."""
    other: str
    sprt: Sprt
    """The test, with the pairs that count."""
    outcomes: tuple[Outcome, ...]
    """The matches of those pairs, and while nothing is decided those that were played ahead of their turn."""
    n_beyond: int
    """Matches that were stored and do not count: they were planned after the deciding pair."""

    @property
    def is_decided(self) -> bool:
        """Whether the test has its verdict."""
        return self.sprt.verdict is not Verdict.GOING_ON

    def verdict(self, most_pairs: int) -> str:
        """Return in words what the test says."""
        sprt, better = self.sprt, f"{self.challenger} is better than {self.other}"
        if sprt.verdict is Verdict.ACCEPTED:
            return f"{better}: {sprt.elo1:g} Elo rather than {sprt.elo0:g}, decided at pair {sprt.n_pairs}"
        if sprt.verdict is Verdict.REJECTED:
            return f"it is not shown that {better}: {sprt.elo0:g} Elo rather than {sprt.elo1:g}, decided at pair {sprt.n_pairs}"
        if sprt.n_pairs < most_pairs:
            return f"it is not decided yet whether {better}, after {sprt.n_pairs} of at most {most_pairs} pairs"
        return f"it stays undecided whether {better}, after all {most_pairs} pairs; raise `pairs` and run the league again"

    def to_dict(self, most_pairs: int) -> dict[str, Any]:
        """Return what a report's document says of the test."""
        sprt, (low, high) = self.sprt, self.sprt.bounds
        bounds = asdict(sprt)
        return {
            "challenger": self.challenger,
            "other": self.other,
            **{name: bounds[name] for name in ("elo0", "elo1", "alpha", "beta")},
            "verdict": sprt.verdict.value,
            "says": self.verdict(most_pairs),
            "pairs": sprt.n_pairs,
            "pentanomial": list(sprt.counts),
            "llr": round(sprt.llr, 4),
            "llr_low": round(low, 4),
            "llr_high": round(high, 4),
            "matches_beyond": self.n_beyond,
        }


def judge(definition: Mapping[str, Any], outcomes: Iterable[Outcome]) -> Duel | None:
    """Return the test of a league, given its stored definition; None if it plays none."""
    if "sprt" not in definition:
        return None
    outcomes = tuple(outcomes)
    challenger = definition["challenger"]
    [other] = set(definition["entries"]) - {challenger}
    complete = list(_complete_row(outcomes))
    sprt = Sprt(**definition["sprt"]).run(pair_scores((outcome for pair in complete for outcome in pair), challenger))
    counted = tuple(outcome for pair in complete[: sprt.n_pairs] for outcome in pair)
    is_decided = sprt.verdict is not Verdict.GOING_ON
    return Duel(
        challenger=challenger,
        other=other,
        sprt=sprt,
        outcomes=counted if is_decided else outcomes,
        n_beyond=len(outcomes) - len(counted) if is_decided else 0,
    )


def _complete_row(outcomes: Iterable[Outcome]) -> Iterator[list[Outcome]]:
    """Yield the matches of each pair from the first on, up to the first pair that is not complete."""
    pairs: defaultdict[int, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        pairs[LeagueMatchId.parse(outcome.identity).pair].append(outcome)
    yield from takewhile(lambda pair: len(pair) == 2, (pairs.get(number, []) for number in range(len(pairs) + 1)))


def next_batch(plans: Sequence[MatchPlan], done: Iterable[str]) -> list[MatchPlan]:
    """Return what is left of the first batch that is not complete; the batches are the same however often a league is stopped.

    Parameters
    ----------
    plans
        All of the league, in their order.
    done
        Identities of the matches that are stored.
    """
    done = set(done)
    begin = 0
    while begin < len(plans):
        end = begin + 2 * max(LEAST_BATCH, begin // (2 * _GROWTH))
        left = [plan for plan in plans[begin:end] if plan.identity not in done]
        if left:
            return left
        begin = end
    return []
