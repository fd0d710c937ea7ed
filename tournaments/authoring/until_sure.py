"""Two fighters play until one is shown to be better, or both to be equal: `arena play --until-sure`.

Two sequential tests look at the same pairs, in their planned order: is the first one better by `margin_elo`, rather than not at
all, and is the second one? Each stops at its own verdict. One that says yes ends it; so do two that say no.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import exp
from statistics import fmean
from typing import Any

from arena.console import quantity
from arena.intervals import margin_of
from arena.local.venue import MatchRecord
from arena.records.plan import MatchPlan
from tournaments.ratings.sprt import Sprt, Verdict
from tournaments.running.duel import next_batch

MOST_PAIRS = 2_000
"""Unless more or fewer are asked for; at 50 Elo a verdict takes 100 to 250, as a rule."""
MARGIN_ELO = 50.0
_ALPHA = 0.025
"""Of each test, so that of two equal fighters one is called better in at most 5% of comparisons."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What is known of two fighters after some pairs."""

    first: str
    second: str
    scores: tuple[float, ...]
    """What the first one scored in each pair that counts, 0 to 2, in their planned order."""
    forward: Sprt
    """Is the first one better? With the pairs up to its own verdict."""
    backward: Sprt

    @classmethod
    def begin(cls, first: str, second: str, margin_elo: float) -> "Comparison":
        """Return what is known before the first pair."""
        test = Sprt(elo0=0.0, elo1=margin_elo, alpha=_ALPHA)
        return cls(first=first, second=second, scores=(), forward=test, backward=test)

    @property
    def better(self) -> str | None:
        """Who is shown to be better, if anybody is."""
        if self.forward.verdict is Verdict.ACCEPTED:
            return self.first
        return self.second if self.backward.verdict is Verdict.ACCEPTED else None

    @property
    def are_equal(self) -> bool:
        """Whether neither is better by the margin, as both tests say."""
        return self.forward.verdict is self.backward.verdict is Verdict.REJECTED

    @property
    def is_decided(self) -> bool:
        """Whether no further pair is needed."""
        return self.better is not None or self.are_equal

    def add(self, scores: Sequence[float]) -> "Comparison":
        """Return what is known after further pairs; those past the deciding one do not count.

        `scores` are the first one's, 0 to 2, in the planned order of the pairs; nothing is decided yet.
        """
        forward, backward = self.forward.run(scores), self.backward.run(2 - score for score in scores)
        accepted = [test.n_pairs for test in (forward, backward) if test.verdict is Verdict.ACCEPTED]
        if accepted:
            n_pairs = min(accepted)
        elif forward.verdict is backward.verdict is Verdict.REJECTED:
            n_pairs = max(forward.n_pairs, backward.n_pairs)
        else:
            return replace(self, scores=(*self.scores, *scores), forward=forward, backward=backward)
        counted = scores[: n_pairs - len(self.scores)]
        return replace(
            self,
            scores=(*self.scores, *counted),
            forward=self.forward.run(counted),
            backward=self.backward.run(2 - score for score in counted),
        )

    def progress(self) -> str:
        """Return in words how far it is."""
        low, high = self.forward.bounds
        tests = (self.first, self.forward), (self.second, self.backward)
        said = [f"{name} better {'no' if test.verdict is Verdict.REJECTED else f'{test.llr:+.2f}'}" for name, test in tests]
        return (
            f"{quantity(len(self.scores), 'pair')}: {self.first} scores {self._score(self.first)}; "
            f"log likelihood ratio, yes from {high:+.2f} on, no from {low:+.2f}: {', '.join(said)}"
        )

    def says(self) -> str:
        """Return the result in a sentence."""
        n_pairs, margin_elo = quantity(len(self.scores), "pair"), self.forward.elo1
        if self.better is not None:
            test, other = (self.forward, self.second) if self.better == self.first else (self.backward, self.first)
            return (
                f"{self.better} is better than {other}: {self._score(self.better)} after {n_pairs}; "
                f"likelihood ratio {exp(test.llr):,.0f} to 1 for {margin_elo:g} Elo rather than 0"
            )
        standing = f"{self.first} scores {self._score(self.first)} after {n_pairs}"
        if self.are_equal:
            return f"neither {self.first} nor {self.second} is better by {margin_elo:g} Elo: {standing}"
        return (
            f"it is not shown who is better, {self.first} or {self.second}: {standing}; allow more --pairs or a larger --margin"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return what `--json` says of it."""
        low, high = self.forward.bounds
        return {
            "verdict": "better" if self.better is not None else "equal" if self.are_equal else "undecided",
            "better": self.better,
            "says": self.says(),
            "margin_elo": self.forward.elo1,
            "llr": {self.first: round(self.forward.llr, 4), self.second: round(self.backward.llr, 4)},
            "llr_low": round(low, 4),
            "llr_high": round(high, 4),
        }

    def _score(self, name: str) -> str:
        points = [score / 2 if name == self.first else 1 - score / 2 for score in self.scores]
        margin = margin_of(points)
        return f"{fmean(points):.2f} +- {margin:.2f}" if margin else f"{fmean(points):.2f}"


def play_until_sure(
    plans: Sequence[MatchPlan],
    begun: Comparison,
    play: Callable[[Sequence[MatchPlan]], Iterator[MatchRecord]],
    say: Callable[[str], None],
) -> tuple[Comparison, list[MatchRecord]]:
    """Play pairs in batches until it is decided who is better, or all are played; return that, and the matches that count.

    Parameters
    ----------
    plans
        A fixture of the two: at most these are played. The two matches of a pair stand side by side.
    say
        Is told in words, after each batch, how far it is.
    """
    now, records = begun, dict[str, MatchRecord]()
    while not now.is_decided and (batch := next_batch(plans, records)):
        records.update((record.plan.identity, record) for record in play(batch))
        new = [records[plan.identity] for plan in batch]
        now = now.add([one.points(now.first) + other.points(now.first) for one, other in zip(new[::2], new[1::2], strict=True)])
        if not now.is_decided:
            say(now.progress())
    return now, [records[plan.identity] for plan in plans[: 2 * len(now.scores)]]
