"""Run a league: play what is not stored yet, and store each match as it ends. Stopped at any moment, it goes on from there."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from arena.errors import ArenaError
from arena.game.types import Termination
from arena.records.plan import MatchPlan
from tournaments.league.edits import is_edited
from tournaments.league.league import League
from tournaments.league.schedule import plan_league
from tournaments.league.secret import commit_to, find_secret
from tournaments.outcome import Outcome
from tournaments.running.duel import Duel, judge, next_batch
from tournaments.running.slots import MOST
from tournaments.store.lock import lock_file
from tournaments.store.store import Store, StoredLeague
from tournaments.venues.recovery import set_aside
from tournaments.venues.setting import Venue, VenueSetting

logger = logging.getLogger(__name__)
MOST_ROUNDS = 3
"""Times that matches which the pit spoiled are played again."""


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

    def homes(self, league: str) -> Path:
        """A folder for the process of each entry."""
        return self.data / "homes" / league

    def season(self, season: str) -> Path:
        """What was submitted to a season, and who may submit."""
        return self.data / "seasons" / season

    def journals(self, league: str) -> Path:
        """A file for each match of a league."""
        return self.data / "journals" / league


class Scheduler:
    """A league that is being run; holds its locks from `with` to the end."""

    def __init__(self, league: League, store: Store, folders: Folders) -> None:
        self._league, self._store, self._folders = league, store, folders
        self._locks = ExitStack()

    def __enter__(self) -> "Scheduler":
        """Take the locks, enter the league into the store, and plan what is left."""
        with self._locks as locks:
            locks.enter_context(self._store.lock(self._league.name))
            # A scheduler with another store would write the same journals.
            locks.enter_context(lock_file(self._folders.journals(self._league.name).with_suffix(".lock"), self._league.name))
            self._enter()
            self._locks = locks.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._locks.close()

    def _enter(self) -> None:
        league, store = self._league, self._store
        before = store.find(league.name)
        n_results = 0 if before is None else store.count(before)
        self.secret = find_secret(league, self._folders.keys, may_make=n_results == 0)
        definition = {**league.definition, "secret": commit_to(self.secret)}
        if n_results == 0 and (before is None or is_edited(before.definition, definition)):
            set_aside(self._folders.journals(league.name))
        self.row: StoredLeague = store.enter(league.name, definition, league.n_pairs)
        self._league = league.labelled(self.row.labels)
        self._plans = plan_league(self._league, self.secret)
        self._done = store.identities(self.row) & {plan.identity for plan in self._plans}
        self.n_matches = len(self._plans)

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to play: every match was, or enough of them to decide a test."""
        return not self._next()

    @property
    def n_done(self) -> int:
        """Matches that are stored."""
        return len(self._done)

    def run(
        self, play: Venue, on_open: Callable[[Mapping[str, str]], None] | None = None, *, slots: int = MOST
    ) -> Iterator[Outcome]:
        """Play what is left, and yield each match once it is stored.

        Parameters
        ----------
        on_open
            Told with which command each entry joins that comes by itself, as soon as it can, and again after a break.
        slots
            Seats that the process of an entry holds at once.

        Raises
        ------
        ArenaError
            Matches were void again and again: the pit spoils them, or the venue does not play them.
        """
        league = self._league
        setting = VenueSetting(
            ruleset=league.ruleset, entries=league.entries, time_control=league.time_control, slots=slots,
            journals=self._folders.journals(league.name), keys=self._folders.keys / league.name,
            homes=self._folders.homes(league.name), sandboxes=league.sandboxes, remote=league.remote, listen=league.listen,
        )  # fmt: skip
        if on_open is not None:
            setting = replace(setting, on_open=on_open)
        while batch := self._next():
            yield from self._play(partial(play, setting), batch)

    def _next(self) -> list[MatchPlan]:
        """Return what is to be played next: all that is left, or of a test so much that it can be looked at again."""
        duel = self._judge() if self._league.sprt is not None else None
        if duel is None:
            return [plan for plan in self._plans if plan.identity not in self._done]
        return [] if duel.is_decided else next_batch(self._plans, self._done)

    def _judge(self) -> Duel | None:
        return judge(self.row.definition, self.row.current(self._store.outcomes(self.row)))

    def _play(self, play: Callable[[Sequence[MatchPlan]], Iterator[Outcome]], plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        left = {plan.identity: plan for plan in plans}
        for _ in range(MOST_ROUNDS):
            if not left:
                return
            for outcome in play(list(left.values())):
                if outcome.result.ending is Termination.VOID or outcome.identity not in left:
                    continue
                self._store.add(self.row, outcome)
                self._done.add(outcome.identity)
                del left[outcome.identity]
                logger.info("match %s is stored", outcome.identity, extra={"facts": outcome.log_facts})
                yield outcome
        if left:
            raise ArenaError(
                f"{len(left)} matches of league {self._league.name} were void {MOST_ROUNDS} times; run it again later"
            )
