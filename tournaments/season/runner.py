"""Play a season: choose what tells most about its table, play it, count it, and rate everybody anew, for months.

Whatever is stored follows from journals that are whole. So a season may be killed at any moment: whoever opens it again takes up
the matches that were begun, reads the results that were not stored yet, and counts none twice.
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from arena.game.types import Termination
from arena.records.journal_folder import JournalFolder
from arena.records.plan import LeagueMatchId, MatchPlan
from tournaments.fixture import plan_pair
from tournaments.league.league import League
from tournaments.league.season import Phase
from tournaments.outcome import Outcome
from tournaments.ratings.standings import Standing
from tournaments.reports.season_table import describe_season
from tournaments.running.slots import SHARE
from tournaments.season.choosing import NEWCOMER_ELO, Player, choose_pairs
from tournaments.season.results import Results, n_pairs_of
from tournaments.season.roster import Roster, read_roster
from tournaments.season.table import Table, rate_season
from tournaments.store.season_store import SeasonStore
from tournaments.store.store import StoredLeague
from tournaments.venues.open_venue import OpenVenue

LEAST_UNDER_WAY, MOST_UNDER_WAY = 6, 16
"""Matches, for each core: when fewer than the first are under way, pairs are chosen up to the second."""
LEAST_WHEN_BUSY, MOST_WHEN_BUSY = 2, 4
"""The same while submissions are checked, whose turns are timed."""
REST_ELO = 40.0
"""When everybody's 95% interval is as narrow as this, nothing is played until something changes."""
ABSENT_S = 15.0
"""Whoever joins by itself may be away for so long before what it has not begun is given up."""
MOST_VOID = 4
"""Void matches of a version without any that counts in between; it is not chosen for some time."""
SUSPENSION_S = 600.0
"""For so long: what made its matches void, as a full disk does, may have passed."""
RATE_EVERY_S = 1.0
"""At most; and rating takes no more than the next share of the time."""
MOST_RATING = 0.1
logger = logging.getLogger(__name__)


class SeasonRunner:
    """Plays a season whose lock is held, a step at a time.

    Parameters
    ----------
    folder
        Of the season, where its submissions are.
    journals
        Folder of its journals.
    clock
        Returns the time, in seconds since 1970.
    rng
        Chooses between pairs that tell the same; nobody may know it before.
    think_s
        What a turn of the entries of its file takes, by label, as far as it was measured.
    n_cores
        That matches are played on.
    owner_of
        Tells whose a key is: some may have one owner, whose entries never meet.
    now
        Returns seconds of a clock that is never set, for what is done some time after something else.
    """

    def __init__(
        self, league: League, store: SeasonStore, row: StoredLeague, secret: bytes, venue: OpenVenue, *,
        folder: Path, journals: Path, clock: Callable[[], float], rng: np.random.Generator,
        think_s: Mapping[str, float] | None = None, n_cores: int = 1, owner_of: Callable[[str], str] = str,
        now: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._league, self._store, self._secret, self._venue = league, store, secret, venue
        self._folder, self._journals, self._clock, self._now, self._rng = folder, journals, clock, now, rng
        self.row = row
        self.results = Results(store.count_results(row), stored := store.identities(row), store.count_forfeits(row))
        self.roster: Roster = read_roster(store, row, league, folder, think_s or {})
        self._n_cores, self._owner_of = n_cores, owner_of
        turn_time_s = league.time_control.turn_time_s
        self._most_thinking_s = inf if turn_time_s is None else SHARE * turn_time_s * n_cores
        self.table: Table = rate_season(self.results, self.roster.labels, self.roster.follows)
        self._plans: dict[str, MatchPlan] = {}
        self._n_void: Counter[str] = Counter()
        self._void_at_s: dict[str, float] = {}
        """When a match of each of these was void last."""
        self._withdrawn: set[str] = set()
        """Matches that are void for no fault of those who were to play them, unless they had begun."""
        self._absent_since_s: dict[str, float] = {}
        self._rated_at_s, self._rate_every_s = 0.0, RATE_EVERY_S
        self._is_rated = False
        self.n_waiting = 0
        """Submissions that wait for their check, as the page shows it."""
        self._invite()
        self._resume(stored)

    @property
    def n_under_way(self) -> int:
        """Matches that were given to the venue and have not ended."""
        return len(self._plans)

    @property
    def suspended(self) -> list[str]:
        """The labels that are not played for now: their matches were void again and again, or their process cannot live."""
        return sorted(label for label in self.roster.entries if self._n_void[label] >= MOST_VOID or label in self._venue.failing)

    def step(self, phase: Phase, *, may_choose: bool = True, is_busy: bool = False) -> list[Outcome]:
        """Do what is to be done now, and return the matches that were counted.

        Parameters
        ----------
        may_choose
            Whether new pairs may begin; else only what is under way is played.
        is_busy
            Whether the machine has something else to do, too.
        """
        self._refresh()
        self._take_off_the_absent()
        least, most = (LEAST_WHEN_BUSY, MOST_WHEN_BUSY) if is_busy else (LEAST_UNDER_WAY, MOST_UNDER_WAY)
        self._end_suspensions()
        if may_choose and len(self._moving) < least * self._n_cores:
            self._choose(most * self._n_cores)
        counted = [outcome for outcome in self._venue.receive() if self._count(outcome)]
        now_s = self._now()
        if not self._is_rated and (now_s - self._rated_at_s >= self._rate_every_s or not self._plans):
            self.table = self._rate()
            self.publish(phase)
            self._is_rated, self._rated_at_s = True, now_s
        return counted

    def publish(self, phase: Phase) -> None:
        """Keep the table for the pages; while a season is frozen, the rows that were kept before."""
        before = self._store.standings(self.row)
        document = self._describe(phase)
        if phase is Phase.FROZEN and before is not None:
            document = {**document, "rows": before["rows"], "matches": before["matches"]}
        self._store.put_standings(self.row, document, self._clock())

    def _describe(self, phase: Phase) -> dict[str, Any]:
        terms, table = self._league.season, self.table
        rows = [
            Standing(
                name=label,
                rating=rating,
                record=self.results.record(label),
                faults={},
                forfeits=self.results.forfeits[label],
                latency=None,
            )
            for label, rating in table.ratings.items()
        ]
        return describe_season(
            self.row.name,
            sorted(rows, key=lambda row: (row.rating.rank, row.name)),
            phase=phase,
            deadline_s=None if terms is None else terms.deadline_s,
            new=[row.name for row in rows if row.rating.elo_high - row.rating.elo_low > NEWCOMER_ELO],
            n_matches=self.results.n_matches,
            n_waiting=self.n_waiting,
            n_playing=self.n_under_way,
            now_s=self._clock(),
        )

    def _refresh(self) -> None:
        """Notice versions that came, and entries that went."""
        row = self._store.get(self.row.name)
        if row.hash == self.row.hash:
            return
        before, table = self.roster, self.table
        self.row, self.roster = row, read_roster(self._store, row, self._league, self._folder, before.think_s)
        gone = set(before.entries) - set(self.roster.entries)
        for label in gone & table.ratings.keys():
            rating, entry = table.ratings[label], before.entries[label]
            found = {key: getattr(rating, key) for key in ("elo", "elo_low", "elo_high")}
            found["matches"] = self.results.record(label).n_matches
            self._store.keep_rating(row, entry.entry, entry.number, found)
        if gone:
            self._withdrawn |= {one.identity for one in self._plans.values() if not gone.isdisjoint((one.blue, one.red))}
            self._venue.withdraw(gone, "another version plays")
        self._invite()
        self.table, self._is_rated = self._rate(), False

    def _invite(self) -> None:
        """Let in those who join by themselves, before there is a match for them: whoever is not there gets none."""
        self._venue.add({label: one for label, one in self.roster.fighters.items() if one.public_key is not None}, [])

    def _rate(self) -> Table:
        """Rate everybody anew; what takes long is done less often."""
        begun_s = time.perf_counter()
        table = rate_season(self.results, self.roster.labels, self.roster.follows, self.table)
        self._rate_every_s = max(RATE_EVERY_S, (time.perf_counter() - begun_s) / MOST_RATING)
        return table

    @property
    def _absent(self) -> set[str]:
        """The labels that join by themselves and are not there."""
        remote = {label for label, fighter in self.roster.fighters.items() if fighter.public_key is not None}
        return remote - self._venue.present

    def _take_off_the_absent(self) -> None:
        """Give up what nobody begins to play, since one of the two has left: it would keep others waiting."""
        now_s = self._now()
        waiting = {label for plan in self._plans.values() for label in (plan.blue, plan.red)} & self._absent
        self._absent_since_s = {label: self._absent_since_s.get(label, now_s) for label in waiting}
        gone = {label for label, since_s in self._absent_since_s.items() if now_s - since_s >= ABSENT_S}
        if gone:
            self._venue.withdraw(gone, "it is not there")

    def _end_suspensions(self) -> None:
        now_s = self._now()
        for label in [label for label, since_s in self._void_at_s.items() if now_s - since_s >= SUSPENSION_S]:
            del self._void_at_s[label], self._n_void[label]

    @property
    def _moving(self) -> list[MatchPlan]:
        """What is under way but for matches that wait for a process which cannot live: they must not keep others waiting."""
        failing = self._venue.failing
        return [plan for plan in self._plans.values() if failing.isdisjoint((plan.blue, plan.red))]

    def _count(self, outcome: Outcome) -> bool:
        """Store a match that ended; False if it was void, or stored before."""
        plan = self._plans.pop(outcome.identity, None)
        if plan is None:
            return False
        labels = (outcome.blue, outcome.red)
        was_withdrawn = outcome.identity in self._withdrawn
        self._withdrawn.discard(outcome.identity)
        if outcome.result.ending is Termination.VOID:
            if self._absent & set(labels):
                return False
            failing = self._venue.failing & set(labels)
            if not was_withdrawn and not failing:  # else it is known whose fault it is, and its opponent has none
                self._n_void.update(labels)
                self._void_at_s |= dict.fromkeys(labels, self._now())
            if not failing and all(label in self.roster.entries and self._n_void[label] < MOST_VOID for label in labels):
                self._add([plan])
            return False
        for label in labels:
            self._n_void.pop(label, None)
            self._void_at_s.pop(label, None)
        if self._store.add(self.row, outcome):
            self.results.add(outcome)
            self._is_rated = False
            return True
        return False

    def _choose(self, most: int) -> None:
        """Give the venue the pairs that tell most, until so many matches are under way, or so many that nobody is made late."""
        left_out = {*self._absent, *self.suspended}
        labels = [label for label in self.table.labels if label not in left_out]
        if len(labels) < 2:
            return
        known = self.table.part(labels)
        if self.table.widths(labels).max() <= REST_ELO:
            return
        index = {label: number for number, label in enumerate(labels)}
        under_way = {tuple(LeagueMatchId.parse(identity).pair_id.split("/")[1:]) for identity in self._plans}
        players = [Player(label=label, owner=self._owner_of(self.roster.entries[label].owner)) for label in labels]
        n_wanted = (most - len(self._moving)) // 2
        chosen = choose_pairs(
            players, known, n_pairs_of(self.results.table(labels)), n_wanted, self._rng,
            [(index[one], index[other]) for one, other, _ in sorted(under_way) if {one, other} <= index.keys()],
        )  # fmt: skip
        for pair in chosen:
            one, other = sorted((labels[pair[0]], labels[pair[1]]))
            if self._plans and self._thinking_s + 2 * self._think_s(one, other) > self._most_thinking_s:
                return
            self._add(self._plan(one, other, self.results.take_pair(one, other)))

    @property
    def _thinking_s(self) -> float:
        """What a turn of all matches that are under way takes together, in seconds of a core."""
        return sum(self._think_s(plan.blue, plan.red) for plan in self._moving)

    def _think_s(self, *labels: str) -> float:
        return sum(self.roster.think_s.get(label, 0.0) for label in labels)

    def _plan(self, one: str, other: str, number: int) -> tuple[MatchPlan, MatchPlan]:
        league = self._league
        return plan_pair(league.name, one, other, number, self._secret, are_maps_fresh=league.maps == "fresh")

    def _add(self, plans: Sequence[MatchPlan]) -> None:
        labels = set(chain.from_iterable((plan.blue, plan.red) for plan in plans))
        for plan in plans:
            self._plans[plan.identity] = plan
        self._venue.add({label: self.roster.fighters[label] for label in labels}, plans)

    def _resume(self, stored: set[str]) -> None:
        """Take up the pairs that were begun, as far as their versions still play."""
        begun = JournalFolder(self._journals).identities() - stored
        pairs = {LeagueMatchId.parse(identity).pair_id for identity in begun} | self.results.halves
        for pair in sorted(pairs):
            _, one, other, number = pair.split("/")
            self.results.skip_pair(one, other, int(number))
            if one in self.roster.entries and other in self.roster.entries:
                self._add([plan for plan in self._plan(one, other, int(number)) if plan.identity not in stored])
        if begun:
            logger.info("%d matches of season %s were begun before", len(begun), self.row.name)
