"""The ladder of a pit that is open: everyone's rating in memory, every result on its way to the store.

Results are written by a thread of their own: the referee's must not wait for a database. What a killed pit had not yet
written, the journals of its matches still tell, and `arena.pit.ladder.find_uncounted` brings back.
"""

import time
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from queue import SimpleQueue
from threading import Thread
from typing import Any

from arena.errors import ArenaError
from arena.game.types import Team, Termination
from arena.metrics.definitions import Reading
from arena.pit.ladder import Backlog, LadderMatch, Waiting
from arena.protocol.identity import to_text
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.matchmaking import Candidate
from tournaments.ladder.matchmaking import choose as choose_pair
from tournaments.ladder.skill import LadderEntry, age, rank, rate, renew
from tournaments.store.schema import StoreError

MOST_REMEMBERED = 10_000
"""Entries whose last opponents are remembered."""
LATELY = 32
"""So many opponents of each."""
OLD_S = 60.0
"""Standings are made anew, even if nobody played: those who stay away become less certain."""
_Row = tuple[LadderMatch, dict[Team, LadderEntry], float]
"""A match, its entries after it, and when it was counted."""


@dataclass(slots=True)
class _Lately:
    """What an entry did lately."""

    met: deque[str] = field(default_factory=lambda: deque(maxlen=LATELY))
    """Keys of its opponents, the last one last."""
    version: str = ""
    """As it said last."""


class RatedLadder:
    """Who is on a ladder; one thread calls it. `clock` returns seconds since 1970."""

    def __init__(self, store: LadderStore, name: str, clock: Callable[[], float] = time.time) -> None:
        self._store, self._name, self._clock = store, name, clock
        self._entries = {entry.key: entry for entry in store.entries(name)}
        self._lately: OrderedDict[str, _Lately] = OrderedDict()
        """By key."""
        self._ranked: list[dict[str, Any]] | None = None
        self._ranked_at_s = 0.0
        self._rows: SimpleQueue[_Row | None] = SimpleQueue()
        self._oldest_at_s: float | None = None
        """When the row that is being stored was counted."""
        self._failure: Exception | None = None
        self._writer = Thread(target=self._write, name="ladder")
        self._writer.start()

    def close(self) -> None:
        """Wait until every result is stored; raises what kept one from it."""
        self._rows.put(None)
        self._writer.join()
        self._check()

    def identities(self) -> Collection[str]:
        """Return the matches that were counted already."""
        return self._store.counted(self._name)

    def choose(self, waiting: Sequence[Waiting], now_s: float) -> tuple[Waiting, Waiting] | None:
        """Return who plays blue, and who red; whoever was blue less often is blue."""
        keys = [to_text(one.entry) for one in waiting]
        index = {key: number for number, key in enumerate(keys)}
        candidates = [self._describe(key, one, index) for key, one in zip(keys, waiting, strict=True)]
        chosen = choose_pair(candidates, now_s)
        if chosen is None:
            return None
        blue, red = sorted(chosen, key=lambda number: self._blueness(keys[number]))
        for mine, other in ((blue, red), (red, blue)):
            lately = self._lately.setdefault(keys[mine], _Lately())
            lately.met.append(keys[other])
            lately.version = waiting[mine].version or lately.version
            self._lately.move_to_end(keys[mine])
        while len(self._lately) > MOST_REMEMBERED:
            self._lately.popitem(last=False)
        return waiting[blue], waiting[red]

    def _describe(self, key: str, waiting: Waiting, index: dict[str, int]) -> Candidate:
        met = self._lately[key].met if key in self._lately else ()
        return Candidate(
            mu=self._entry(key).mu,
            since_s=waiting.since_s,
            owner=waiting.owner,
            last=index.get(met[-1]) if met else None,
            n_met={index[other]: n for other, n in Counter(met).items() if other in index},
        )

    def _blueness(self, key: str) -> int:
        entry = self._entry(key)
        return 2 * entry.n_blue - entry.n_matches

    def _entry(self, key: str) -> LadderEntry:
        return self._entries.get(key) or LadderEntry(key=key, name="")

    def count(self, match: LadderMatch) -> None:
        """Rate a match that ended, and leave it to be stored."""
        self._check()
        after: dict[Team, LadderEntry] = {}
        now_s = self._clock()
        if match.result.ending is not Termination.VOID:
            before = {team: self._find_playing(to_text(match.entries[team]), match.names[team]) for team in Team}
            after = rate(before, match.result, now_s)
            self._entries.update((entry.key, entry) for entry in after.values())
            self._ranked = None
        self._rows.put((match, after, now_s))

    def _find_playing(self, key: str, name: str) -> LadderEntry:
        """Return an entry before a match that it has played, by the version that it came with last."""
        version = self._lately[key].version if key in self._lately else ""
        return renew(replace(self._entry(key), name=name), version)

    def standings(self) -> list[dict[str, Any]]:
        """Return everyone who has a rating, the best first."""
        now_s = self._clock()
        if self._ranked is None or abs(now_s - self._ranked_at_s) > OLD_S:
            self._ranked, self._ranked_at_s = rank([age(entry, now_s) for entry in self._entries.values()]), now_s
        return self._ranked

    def readings(self) -> list[Reading]:
        """Return what a monitor is told of the store, on any thread."""
        return self._store.readings()

    def backlog(self) -> Backlog:
        """Return what is not stored yet."""
        oldest_at_s = self._oldest_at_s
        if oldest_at_s is None:
            return Backlog(self._rows.qsize(), 0.0)
        return Backlog(self._rows.qsize() + 1, max(self._clock() - oldest_at_s, 0.0))

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _write(self) -> None:
        """Store results as they come; after a failure none is stored any more, and the pit hears of it with the next."""
        while (row := self._rows.get()) is not None:
            match, after, self._oldest_at_s = row
            if self._failure is None:
                try:
                    self._store.count_match(self._name, match, after, self._oldest_at_s)
                except ArenaError as error:
                    self._failure = error
            self._oldest_at_s = None


@contextmanager
def open_ladder(db: str, pit: str, rules_hash: str, clock: Callable[[], float] = time.time) -> Iterator[RatedLadder]:
    """Keep the ladder of a pit in the store at `db`, as long as nobody else does, and its rules are what they were."""
    with LadderStore(db) as store, store.keep(pit):
        before = store.find_rules(pit)
        if before not in (None, rules_hash):
            raise StoreError(
                f"the ladder of {pit} is played under other rules ({str(before)[:8]}, these are {rules_hash[:8]}); "
                "choose another name with --pit"
            )
        ladder = RatedLadder(store, pit, clock)
        try:
            yield ladder
        finally:
            ladder.close()
