"""A venue that stays open: matches are given to it at any time, and come back as they end.

The venue `network` is one by nature. The others play one batch after another, each of all that came meanwhile.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import Protocol, Self

from arena.errors import InputError
from arena.game.types import Team, Termination
from arena.network.address import Address
from arena.policy import MatchResult
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.setting import Fighter, Venue, VenueSetting
from tournaments.venues.table import find_venue

_POLL_S = 0.2


class OpenVenue(Protocol):
    """Plays what it is given; used by `with`, by one thread."""

    @property
    def address(self) -> Address | None:
        """Where entries join by themselves, if they can."""

    @property
    def present(self) -> frozenset[str]:
        """The entries that join by themselves and are there."""

    @property
    def failing(self) -> frozenset[str]:
        """The entries whose process dies again and again, or was given up: their matches begin late or never."""

    def add(self, entries: Mapping[str, Fighter], plans: Sequence[MatchPlan]) -> None:
        """Let entries in, by label, and play matches; an entry that is known may be named again, as it is."""

    def withdraw(self, names: Collection[str], reason: str) -> None:
        """Begin no more matches of these entries; those that were not begun are received as void, for this reason."""

    def receive(self) -> list[Outcome]:
        """Return the matches that ended meanwhile; wait for some, but only for a moment.

        Raises
        ------
        ArenaError
            The venue cannot go on.
        """

    def __enter__(self) -> Self:
        """Open it."""

    def __exit__(self, *_: object) -> None:
        """End all that it has started."""


def open_venue(name: str, setting: VenueSetting) -> OpenVenue:
    """Return one of `tournaments.league.league.VENUES`, to be used by `with`; `InputError` if what it needs is not installed."""
    if name == "network":
        from tournaments.venues.network import NetworkPit

        return NetworkPit(setting)
    return BatchVenue(find_venue(name), setting)


class BatchVenue:
    """A venue of batches as one that stays open."""

    address: Address | None = None
    present: frozenset[str] = frozenset()
    failing: frozenset[str] = frozenset()

    def __init__(self, play: Venue, setting: VenueSetting) -> None:
        self._play, self._setting = play, setting
        self._fighters: dict[str, Fighter] = dict(setting.fighters)
        self._waiting: deque[MatchPlan] = deque()
        self._withdrawn: list[Outcome] = []
        self._ended: SimpleQueue[Outcome] = SimpleQueue()
        self._thread = ThreadPoolExecutor(1, "batch")
        self._batch: Future[None] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._waiting.clear()
        self._thread.shutdown()

    def add(self, entries: Mapping[str, Fighter], plans: Sequence[MatchPlan]) -> None:
        """Let entries in, and play matches in the next batch."""
        for name, fighter in entries.items():
            if fighter.public_key is not None:
                raise InputError(f"{name} joins by itself, and can only come to the venue network")
        self._fighters |= entries
        self._waiting.extend(plans)
        self._begin()

    def withdraw(self, names: Collection[str], reason: str) -> None:
        """Take what waits for the next batch off it; what is in one is played."""
        gone = [plan for plan in self._waiting if plan.blue in names or plan.red in names]
        self._waiting = deque(plan for plan in self._waiting if plan not in gone)
        result = MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=0, reason=reason)
        self._withdrawn += [Outcome.of(plan, result, {team: SeatOutcome() for team in Team}) for plan in gone]

    def receive(self) -> list[Outcome]:
        """Return the matches that ended meanwhile."""
        is_done = self._batch is not None and self._batch.done()
        ended, self._withdrawn = self._withdrawn, []
        with suppress(Empty):
            while True:
                ended.append(self._ended.get(timeout=0 if ended or is_done else _POLL_S))
        if is_done and self._batch is not None:
            self._batch.result()
            self._batch = None
            self._begin()
        return ended

    def _begin(self) -> None:
        if self._batch is not None or not self._waiting:
            return
        plans = list(self._waiting)
        self._waiting.clear()
        names = {name for plan in plans for name in (plan.blue, plan.red)}
        fighters = {name: self._fighters[name] for name in names}
        setting = replace(
            self._setting,
            entries={name: one.spec for name, one in fighters.items()},
            sandboxes={name: one.sandbox for name, one in fighters.items() if one.sandbox is not None},
        )
        self._batch = self._thread.submit(self._run, setting, plans)

    def _run(self, setting: VenueSetting, plans: Sequence[MatchPlan]) -> None:
        for outcome in self._play(setting, plans):
            self._ended.put(outcome)
