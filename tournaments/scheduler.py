"""Run a league: play what is not stored yet, and store each match as it ends. Stopped at any moment, it goes on from there."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from arena.errors import ArenaError
from arena.game.types import Ending
from arena.referee.local import MatchPlan
from tournaments.league import League
from tournaments.outcome import Outcome
from tournaments.schedule import plan_league
from tournaments.secret import commit_to, find_secret
from tournaments.store import Store, StoredLeague

if TYPE_CHECKING:
    from tournaments.venues import Setting

MOST_ROUNDS = 3
"""Times that matches which the pit spoiled are played again."""
Venue = Callable[["Setting", Sequence[MatchPlan]], Iterator[Outcome]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Folders:
    """Where a league's things live."""

    data: Path

    @property
    def keys(self) -> Path:
        """Secrets of leagues."""
        return self.data / "keys"

    @property
    def reports(self) -> Path:
        """One HTML file for each league."""
        return self.data / "reports"

    def journals(self, league: str) -> Path:
        """A file for each match of a league."""
        return self.data / "journals" / league


class Scheduler:
    """A league that is being run; holds its lock from `with` to the end."""

    def __init__(self, league: League, store: Store, folders: Folders) -> None:
        self._league, self._store, self._folders = league, store, folders
        self._lock = store.lock(league.name)

    def __enter__(self) -> "Scheduler":
        """Take the lock, enter the league into the store, and plan what is left."""
        self._lock.__enter__()
        try:
            self._enter()
        except BaseException:
            self._lock.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.__exit__(None, None, None)

    def _enter(self) -> None:
        league, store = self._league, self._store
        before = store.find(league.name)
        n_results = 0 if before is None else store.count(before)
        self.secret = find_secret(league, self._folders.keys, may_make=n_results == 0)
        self.row: StoredLeague = store.enter(league.name, {**league.facts, "secret": commit_to(self.secret)}, league.n_pairs)
        plans = plan_league(league, self.secret)
        done = store.identities(self.row)
        self.n_matches = len(plans)
        self.left = [plan for plan in plans if plan.identity not in done]

    def run(self, play: Venue) -> Iterator[Outcome]:
        """Play what is left, and yield each match once it is stored.

        Raises
        ------
        ArenaError
            Matches were void again and again: the pit spoils them, or the venue does not play them.
        """
        from tournaments.venues import Setting

        league = self._league
        setting = Setting(
            ruleset=league.ruleset, entries=league.entries, terms=league.terms, slots=league.slots,
            journals=self._folders.journals(league.name), keys=self._folders.keys / league.name,
            homes=self._folders.data / "homes" / league.name, limits=league.limits,
        )  # fmt: skip
        left = {plan.identity: plan for plan in self.left}
        for _ in range(MOST_ROUNDS):
            if not left:
                return
            for outcome in play(setting, list(left.values())):
                if outcome.ending is Ending.VOID or outcome.identity not in left:
                    continue
                self._store.add(self.row, outcome)
                del left[outcome.identity]
                yield outcome
        if left:
            raise ArenaError(f"{len(left)} matches of league {league.name} were void {MOST_ROUNDS} times; run it again later")
