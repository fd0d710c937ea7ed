"""Venues that go on, as a season needs them: entries and matches are added while others are played, to whichever venue it is."""

from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import replace
from importlib import import_module
from queue import Empty, SimpleQueue
from threading import Condition, Thread
from typing import Protocol, Self, cast

from arena.errors import InputError
from arena.network.address import Address
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome
from tournaments.venues.bundle import freeze
from tournaments.venues.setting import Fighter, Venue, VenueSetting, check_plans
from tournaments.venues.table import find_venue

_WAIT_S = 0.2
Session = Callable[[], AbstractContextManager[None]]


class OpenVenue(Protocol):
    """Plays what it is given; used by `with`, from one thread. `tournaments.venues.network.NetworkPit` is the model."""

    def __enter__(self) -> Self:
        """Begin to play."""

    def __exit__(self, *_: object) -> None:
        """Close it."""

    @property
    def n_left(self) -> int:
        """Matches that were added and have not ended."""

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
        """Let entries in, by label, and put matches at the end of the plan; one that is known may be named again, as it is."""

    def withdraw(self, names: Collection[str], reason: str) -> None:
        """Take off the plan what these entries have not begun to play; it is received as void, for this reason."""

    def receive(self) -> list[Outcome]:
        """Return the matches that ended meanwhile; wait for some, but only for a moment.

        Raises
        ------
        ArenaError
            The venue cannot go on.
        """

    def close(self) -> None:
        """Play no more. What ended before, and was not received yet, `receive` still returns."""


def open_venue(name: str, setting: VenueSetting) -> OpenVenue:
    """Return one of `tournaments.league.league.VENUES` that goes on; `InputError` if what it needs is not installed."""
    if name == "network":
        from tournaments.venues.network import NetworkPit

        return NetworkPit(setting)
    play = find_venue(name)
    session = getattr(import_module(play.__module__), "session", nullcontext)
    return BatchVenue(play, setting, session=cast(Session, session))


class BatchVenue:
    """A venue that plays batches, in a thread: each of all that waits when the one before is over.

    Parameters
    ----------
    play
        The venue.
    setting
        Its entries are known from the beginning.
    session
        What the venue is to stay within, from its first batch to its last.
    """

    address: Address | None = None
    present: frozenset[str] = frozenset()
    failing: frozenset[str] = frozenset()

    def __init__(self, play: Venue, setting: VenueSetting, *, session: Session = nullcontext) -> None:
        self._play, self._setting, self._session = play, setting, session
        self._fighters: dict[str, Fighter] = {}
        self._left: dict[str, MatchPlan] = {}
        self._waiting: dict[str, MatchPlan] = {}
        """Those that no batch holds yet; changed under `_changed`, as all that the thread looks at."""
        self._changed = Condition()
        self._is_closed = False
        self._ended: SimpleQueue[Outcome | BaseException] = SimpleQueue()
        self._failure: BaseException | None = None
        self._thread = Thread(target=self._run, name="plays batches", daemon=True)
        self.add(setting.fighters, ())

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def n_left(self) -> int:
        """Matches that were added and have not ended."""
        return len(self._left)

    def add(self, entries: Mapping[str, Fighter], plans: Sequence[MatchPlan]) -> None:
        """Let entries in, by label, and put matches at the end of the plan.

        Raises
        ------
        InputError
            The file of a fighter cannot be read, or one joins by itself, which it can only do in a pit.
        ValueError
            A match is on the plan already, or of an entry that is not known.
        """
        for name, fighter in entries.items():
            if fighter.public_key is not None:
                raise InputError(f'{name} joins by itself, and who does can only come to venue = "network"')
        check_plans(plans, self._left, {*entries, *self._fighters}, "venue")
        frozen = freeze({name: fighter for name, fighter in entries.items() if name not in self._fighters})
        with self._changed:
            self._fighters |= frozen
            self._waiting |= {plan.identity: plan for plan in plans}
            self._left |= {plan.identity: plan for plan in plans}
            self._changed.notify()

    def withdraw(self, names: Collection[str], reason: str) -> None:
        """Take off the plan what these entries have not begun to play; it is received as void, for this reason."""
        with self._changed:
            gone = [plan for plan in self._waiting.values() if plan.blue in names or plan.red in names]
            for plan in gone:
                del self._waiting[plan.identity]
        for plan in gone:
            self._ended.put(Outcome.void(plan, reason))

    def receive(self) -> list[Outcome]:
        """Return the matches that ended meanwhile; wait for some, but only for a moment.

        Raises
        ------
        BaseException
            What the venue raised, once all that ended before was received.
        """
        if self._failure is not None:
            raise self._failure
        outcomes: list[Outcome] = []
        while self._failure is None:
            try:
                ended = self._ended.get(timeout=0 if outcomes or self._is_closed else _WAIT_S)
            except Empty:
                break
            if not isinstance(ended, Outcome):
                self._failure = ended
            elif self._left.pop(ended.identity, None) is not None:
                outcomes.append(ended)
        if self._failure is not None and not outcomes:
            raise self._failure
        return outcomes

    def close(self) -> None:
        """Begin nothing more, and wait for the next match that ends; others that are played are given up."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            with self._session():
                for setting, plans in self._batches():
                    with closing(cast("Generator[Outcome]", self._play(setting, plans))) as outcomes:
                        for outcome in outcomes:
                            self._ended.put(outcome)
                            if self._is_closed:
                                return
        except BaseException as error:  # noqa: BLE001 - raised anew by whoever receives
            self._ended.put(error)

    def _batches(self) -> Iterator[tuple[VenueSetting, list[MatchPlan]]]:
        """Yield what to play next, with a setting that knows who plays it."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._is_closed)
                if self._is_closed:
                    return
                plans = list(self._waiting.values())
                self._waiting.clear()
                fighters = {name: self._fighters[name] for name in {name for one in plans for name in (one.blue, one.red)}}
            sandboxes = {name: one.sandbox for name, one in fighters.items() if one.sandbox is not None}
            yield replace(self._setting, entries={n: one.spec for n, one in fighters.items()}, sandboxes=sandboxes), plans
