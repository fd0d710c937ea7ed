"""What an author hears of a bot while it plays: why its units stayed, each kind once, and counted after."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

from arena.console import quantity, say
from arena.game.types import Team, Termination
from arena.local.venue import MatchRecord, News
from arena.policy import MatchResult
from arena.records.plan import MatchPlan

_WHEN_AND_WHAT_THEN = re.compile(r"^tick \d+: |; [^;]*$")
_FORFEIT = "forfeit"


@dataclass(slots=True, kw_only=True)
class _Reason:
    """Why an entry's units stayed."""

    match: str
    team: Team
    sentence: str
    """Of the first time."""
    n_turns: int = 0
    n_matches: int = 0


class Feedback:
    """Says the first of each kind at once, on stderr, and counts all; news come from any thread."""

    def __init__(self, plans: Sequence[MatchPlan]) -> None:
        self._plans = {plan.identity: plan for plan in plans}
        self._reasons: dict[tuple[str, str], _Reason] = {}
        """By entry and kind."""
        self._results: dict[str, MatchResult] = {}
        self._lock = Lock()

    @property
    def n_ended(self) -> int:
        """How many matches have ended."""
        return len(self._results)

    def hear(self, news: News) -> bool:
        """Take news of a match; return whether they were none."""
        plan = self._plans[news.identity]
        with self._lock:
            is_new = news.identity not in self._results
            self._results[news.identity] = news.result
            for team, reasons in zip(Team, news.reasons, strict=True):
                for kind, sentence in reasons.items():
                    self._tell(plan, team, kind, sentence)
            if news.result.ending is Termination.FORFEIT:
                for team in Team:
                    if team is not news.result.winner:
                        self._tell(plan, team, _FORFEIT, f"forfeited: {news.result.reason}")
        return is_new

    def count(self, record: MatchRecord) -> bool:
        """Count what a match's record says; return whether there were no news of it before."""
        blue, red = ({kind: first for kind, (first, _) in faults.reasons.items()} for faults in record.faults)
        is_new = self.hear(News(record.plan.identity, record.result, (blue, red)))
        for team, faults in zip(Team, record.faults, strict=True):
            for kind, (_, n_turns) in faults.reasons.items():
                reason = self._reasons[record.plan.entry(team), kind]
                reason.n_turns += n_turns
                reason.n_matches += 1
        if record.result.ending is Termination.FORFEIT:
            for team in Team:
                if team is not record.result.winner:
                    self._reasons[record.plan.entry(team), _FORFEIT].n_matches += 1
        return is_new

    def summary(self) -> list[str]:
        """Return a line for each kind: what it was, and how often."""
        lines = []
        for (entry, kind), reason in self._reasons.items():
            what = _WHEN_AND_WHAT_THEN.sub("", reason.sentence)
            turns = "" if kind == _FORFEIT else f"{quantity(reason.n_turns, 'turn')} in "
            lines.append(f"{entry}: {what}: {turns}{quantity(reason.n_matches, 'match', 'matches')}")
        return lines

    def facts(self, entry: str) -> list[dict[str, Any]]:
        """Return for programs what `summary` says of an entry."""
        return [
            {
                "kind": kind,
                "first": reason.sentence,
                "match": reason.match,
                "team": reason.team.name.lower(),
                "turns": reason.n_turns,
                "matches": reason.n_matches,
            }
            for (who, kind), reason in self._reasons.items()
            if who == entry
        ]

    def stopped(self, one: str, other: str) -> str:
        """Return how it stood between two entries when it was stopped."""
        with self._lock:
            results = dict(self._results)
        won: Counter[str] = Counter()
        for identity, result in results.items():
            won["" if result.winner is None else self._plans[identity].entry(result.winner)] += 1
        return (
            f"stopped after {len(results)} of {quantity(len(self._plans), 'match', 'matches')}: "
            f"{one} won {won[one]}, {other} won {won[other]}, {won['']} drawn"
        )

    def _tell(self, plan: MatchPlan, team: Team, kind: str, sentence: str) -> None:
        entry = plan.entry(team)
        if (entry, kind) not in self._reasons:
            self._reasons[entry, kind] = _Reason(match=plan.identity, team=team, sentence=sentence)
            say(f"{entry}, match {plan.identity} as {team.name.lower()}: {sentence}", err=True)
