"""A season in one process: what is submitted comes in at a router of its own, is checked behind walls, and plays in its venue.

author -- router --> Desk --> submissions --> Intake --> versions --> SeasonRunner --> venue
                              (in the store)  (a thread)              (this thread)
"""

import logging
import os
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from math import inf
from typing import Any, Self

import numpy as np

from arena.keyring.files import load_or_make
from arena.metrics.definitions import TURN_BOUNDS_S, Histogram
from arena.network.address import Address
from arena.network.session import open_router
from arena.pit.register import Register, read_invites
from tournaments.league.entries import REMOTE
from tournaments.league.league import League
from tournaments.league.season import Phase
from tournaments.league.secret import commit_to, find_secret
from tournaments.outcome import Outcome
from tournaments.running.scheduler import Folders
from tournaments.running.slots import MOST as MOST_SLOTS
from tournaments.season.desk import Desk
from tournaments.season.final import play_final
from tournaments.season.intake import CheckTerms, Intake
from tournaments.season.owners import OwnerRequests
from tournaments.season.phases import find_phase
from tournaments.season.runner import SeasonRunner
from tournaments.season.submitted import SubmittedFolder
from tournaments.store.lock import lock_file
from tournaments.store.season_store import WAITING, SeasonEntry, SeasonStore
from tournaments.venues.open_venue import open_venue
from tournaments.venues.setting import VenueSetting
from tournaments.venues.table import find_venue

_LOOK_S = 1.0
"""Between two looks at what waits."""
logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonEvents:
    """Whom a season tells how it goes; all are called on the thread that runs it."""

    on_open: Callable[[Address], None] = lambda _: None
    """Told where authors submit."""
    on_phase: Callable[[Phase], None] = lambda _: None
    on_versions: Callable[[list[str], list[str]], None] = lambda *_: None
    """Told of the labels that play from now on, and of those that do no more."""
    on_invitation: Callable[[Mapping[str, str]], None] = lambda _: None
    """Told with which command each entry joins that comes by itself, where that is known."""


@dataclass(slots=True, kw_only=True)
class SeasonState:
    """What a monitor is told of a season; the thread that runs it sets each of these anew, and changes none in place."""

    n_matches: int = 0
    n_playing: int = 0
    n_waiting: int = 0
    endings: dict[str, int] = field(default_factory=dict)
    """Of the matches that ended since it was opened."""
    faults: dict[str, int] = field(default_factory=dict)
    """That were counted in them."""
    n_ticks: int = 0
    p99s: Histogram = field(default_factory=lambda: Histogram(TURN_BOUNDS_S))
    """Of the turns of each of their seats, the 99th percentile."""
    looked_at_s: float = field(default_factory=time.monotonic)
    """When its thread last did something, by the monotonic clock."""


class Season:
    """A season that is run; holds its locks from `with` to the end.

    Parameters
    ----------
    think_s
        What a turn of each of its file's entries takes, as far as it was measured.
    clock
        Seconds since 1970.
    """

    def __init__(
        self,
        league: League,
        store: SeasonStore,
        folders: Folders,
        *,
        events: SeasonEvents,
        think_s: Mapping[str, float],
        clock: Callable[[], float] = time.time,
    ) -> None:
        if league.season is None:
            raise ValueError(f"league {league.name} is no season")
        self._league, self._terms, self._store, self._folders = league, league.season, store, folders
        self._events, self._clock, self._think_s = events, clock, think_s
        self._folder = folders.season(league.name)
        self._locks = ExitStack()
        self.state = SeasonState()
        self._owner_of: Callable[[str], str] = str
        self._suspended: frozenset[str] = frozenset()
        self._phase: Phase | None = None
        self._address: Address | None = None
        """Of the pit that is open, for those who join by themselves."""

    def __enter__(self) -> Self:
        league, store = self._league, self._store
        with self._locks as locks:
            locks.enter_context(store.lock(league.name))
            locks.enter_context(lock_file(self._folders.journals(league.name).with_suffix(".lock"), league.name))
            self._secret = find_secret(league, self._folders.keys, may_make=store.find(league.name) is None)
            definition = {**league.definition, "secret": commit_to(self._secret)}
            self.row = store.open_season(league.name, definition, self._clock())
            self._locks = locks.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._locks.close()

    def run(self, venue: str, is_stopped: Callable[[], bool]) -> Iterator[Outcome]:
        """Play until the season is over, or stopped; yield each match once it is stored.

        Raises
        ------
        ArenaError
            The venue, the store, or what takes submissions cannot go on.
        """
        if self.row.secret is not None:
            self._enter_phase(Phase.OVER)
            return
        with self._submissions(venue) as (desk, intake):
            runner = yield from self._play(venue, is_stopped, desk, intake)
            if is_stopped():
                return
            self._enter_phase(Phase.FINAL)
            yield from self._play_final(runner, venue, is_stopped)

    @contextmanager
    def _submissions(self, venue: str) -> Iterator[tuple[Desk, Intake]]:
        """Take submissions, and check them."""
        league, terms, store = self._league, self._terms, self._store
        identity = load_or_make(self._folders.keys / league.name / "season.key")
        folder = SubmittedFolder(self._folder)
        check = CheckTerms(
            ruleset=league.ruleset,
            time_control=league.time_control,
            limits=league.strangers_sandbox.limits,
            has_wall=league.has_walls,
            most_bytes=terms.most_kb * 1_000,
        )
        intake = Intake(store, self.row, folder, check, clock=self._clock)
        invites = None if terms.invites is None else read_invites(terms.invites)
        owners = OwnerRequests(
            store, self.row, terms, folder, self._folders.journals(league.name),
            Register(self._folder / "register.json", invites),
            clock=self._clock, on_submission=intake.wake, describe=self._describe_entry,
            why_not_remote=why_not_remote(league, venue),
        )  # fmt: skip
        address = Address(endpoint=terms.submissions, pit=league.name, fingerprint=identity.fingerprint)
        self._owner_of = owners.owner_of
        with open_router(address.endpoint, address.pit) as session, intake, Desk(session, league.name, identity, owners) as desk:
            self._events.on_open(address)
            yield desk, intake

    def _describe_entry(self, entry: SeasonEntry) -> dict[str, Any]:
        """Return what the owner of an entry is told beside its own versions: where it stands, where its page is, and its pit."""
        table = self._store.standings(self.row)
        rows = [] if table is None else [row for row in table["rows"] if row["label"] == entry.label]
        is_remote = any(
            one.label == entry.label and one.spec.startswith(REMOTE) for one in self._store.versions(self.row, entry.entry)
        )
        command = f"arena join '{self._address}' --name {entry.label} --key FILE --forever"
        return {
            "standing": rows[0] if rows else None,
            "page": self._terms.page,
            "is_suspended": entry.label in self._suspended,
            "join": command if is_remote and self._address is not None else "",
        }

    def _play(
        self, venue: str, is_stopped: Callable[[], bool], desk: Desk, intake: Intake
    ) -> Generator[Outcome, None, SeasonRunner]:
        """Play the season itself until its final can begin; return what knows how it stands."""
        league, folders = self._league, self._folders
        setting = VenueSetting(
            ruleset=league.ruleset, entries={}, time_control=league.time_control, slots=league.slots or MOST_SLOTS,
            journals=folders.journals(league.name), keys=folders.keys / league.name, homes=folders.homes(league.name),
            listen=league.listen,
        )  # fmt: skip
        with open_venue(venue, setting) as pit:
            self._address = pit.address if self._league.listen else None
            runner = SeasonRunner(
                league, self._store, self.row, self._secret, pit, folder=self._folder, journals=setting.journals,
                clock=self._clock, rng=np.random.default_rng(int.from_bytes(os.urandom(16), "big")),
                think_s=self._think_s, n_cores=len(os.sched_getaffinity(0)), owner_of=self._owner_of,
            )  # fmt: skip
            next_look_s = 0.0
            phase = Phase.OPEN
            while not is_stopped():
                now_s = time.monotonic()
                if now_s >= next_look_s:
                    next_look_s = now_s + _LOOK_S
                    for part in (desk, intake):
                        if part.failure is not None:
                            raise part.failure
                    runner.n_waiting = len(self._store.submissions(self.row, state=WAITING))
                    phase = find_phase(self._terms, self._clock(), n_waiting=runner.n_waiting)
                    if phase is not self._phase and phase is not Phase.FINAL:
                        self._enter_phase(phase)
                        runner.publish(phase)
                if phase is Phase.FINAL and not runner.n_under_way:
                    break
                before = runner.roster.entries.keys()
                for outcome in runner.step(phase, may_choose=phase is not Phase.FINAL, is_busy=intake.is_checking):
                    self._count(outcome)
                    yield outcome
                self._note(runner)
                now = runner.roster.entries.keys()
                if now != before:
                    self._events.on_versions(sorted(now - before), sorted(before - now))
            return runner

    def _play_final(self, runner: SeasonRunner, venue: str, is_stopped: Callable[[], bool]) -> Iterator[Outcome]:
        """Play the final, and publish the secrets of both."""
        runner.publish(Phase.FINAL)
        self.state.looked_at_s = inf  # it watches over its processes itself, and may wait for some
        for outcome in play_final(
            self._league, runner.roster, self._store, self._folders, find_venue(venue), is_stopped=is_stopped,
            on_invitation=self._events.on_invitation,
        ):  # fmt: skip
            self._count(outcome)
            yield outcome
        if is_stopped():
            return
        self.row = self._store.close(runner.row, self._secret)
        runner.publish(Phase.OVER)
        self._enter_phase(Phase.OVER)

    def _enter_phase(self, phase: Phase) -> None:
        self._phase = phase
        self._events.on_phase(phase)

    def _count(self, outcome: Outcome) -> None:
        logger.info("match %s is stored", outcome.identity, extra={"facts": outcome.log_facts})
        ending = outcome.result.ending.name.lower()
        self.state.endings = {**self.state.endings, ending: self.state.endings.get(ending, 0) + 1}
        self.state.n_ticks += outcome.result.ticks
        faults = Counter(self.state.faults)
        for seat in outcome.seats.values():
            faults.update(seat.faults)
        self.state.faults = dict(faults)
        p99s = self.state.p99s.copy()
        p99s.add(seat.latency_p99_s for seat in outcome.seats.values() if seat.latency_p99_s is not None)
        self.state.p99s = p99s

    def _note(self, runner: SeasonRunner) -> None:
        self._suspended = frozenset(runner.suspended)
        self.state.n_matches, self.state.n_playing = runner.results.n_matches, runner.n_under_way
        self.state.n_waiting, self.state.looked_at_s = runner.n_waiting, time.monotonic()


def why_not_remote(league: League, venue: str) -> str:
    """Return why no entry of a season can join by itself, or nothing."""
    if venue != "network":
        return "this season plays where nobody joins by itself; submit the bot without --remote"
    if not league.listen:
        return "this season has no address at which entries join by themselves; submit the bot without --remote"
    if league.maps != "fresh":
        return "this season plays each map twice, which who joins by itself may remember; submit the bot without --remote"
    return ""
