"""The ladder of a pit that is open: everyone's rating in memory, every result on its way to the store.

Results are written by a thread of their own: the referee's must not wait for a database. What a killed pit had not yet
written, the journals of its matches still tell, and `arena.pit.ladder.find_uncounted` brings back.
"""

import time
from collections import OrderedDict
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from queue import SimpleQueue
from threading import Thread
from typing import Any

from arena.errors import ArenaError
from arena.game.types import Team, Termination
from arena.pit.ladder import Backlog, LadderMatch, Waiting
from arena.protocol.identity import to_text
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.matchmaking import Candidate
from tournaments.ladder.matchmaking import choose as choose_pair
from tournaments.ladder.skill import LadderEntry, rank, rate
from tournaments.store.schema import StoreError

MOST_REMEMBERED = 10_000
"""Entries whose last opponent is remembered."""
_Row = tuple[LadderMatch, dict[Team, LadderEntry], float]
"""With when it was counted."""


class RatedLadder:
    """Who is on a ladder; one thread calls it."""

    def __init__(self, store: LadderStore, name: str) -> None:
        self._store, self._name = store, name
        self._entries = {entry.key: entry for entry in store.entries(name)}
        self._last: OrderedDict[str, str] = OrderedDict()
        """By key: whom it met last."""
        self._ranked: list[dict[str, Any]] | None = None
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
        candidates = [
            Candidate(mu=self._entry(key).mu, since_s=one.since_s, last=index.get(self._last.get(key, "")))
            for key, one in zip(keys, waiting, strict=True)
        ]
        chosen = choose_pair(candidates, now_s)
        if chosen is None:
            return None
        blue, red = sorted(chosen, key=lambda number: self._blueness(keys[number]))
        for mine, other in ((keys[blue], keys[red]), (keys[red], keys[blue])):
            self._last[mine] = other
            self._last.move_to_end(mine)
        while len(self._last) > MOST_REMEMBERED:
            self._last.popitem(last=False)
        return waiting[blue], waiting[red]

    def _blueness(self, key: str) -> int:
        entry = self._entry(key)
        return 2 * entry.n_blue - entry.n_matches

    def _entry(self, key: str) -> LadderEntry:
        return self._entries.get(key) or LadderEntry(key=key, name="")

    def count(self, match: LadderMatch) -> None:
        """Rate a match that ended, and leave it to be stored."""
        self._check()
        after: dict[Team, LadderEntry] = {}
        if match.result.ending is not Termination.VOID:
            before = {team: replace(self._entry(to_text(match.entries[team])), name=match.names[team]) for team in Team}
            after = rate(before, match.result)
            self._entries.update((entry.key, entry) for entry in after.values())
            self._ranked = None
        self._rows.put((match, after, time.monotonic()))

    def standings(self) -> list[dict[str, Any]]:
        """Return everyone who has a rating, the best first."""
        if self._ranked is None:
            self._ranked = rank(list(self._entries.values()))
        return self._ranked

    def backlog(self) -> Backlog:
        """Return what is not stored yet."""
        oldest_at_s = self._oldest_at_s
        if oldest_at_s is None:
            return Backlog(self._rows.qsize(), 0.0)
        return Backlog(self._rows.qsize() + 1, time.monotonic() - oldest_at_s)

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _write(self) -> None:
        """Store results as they come; after a failure none is stored any more, and the pit hears of it with the next."""
        while (row := self._rows.get()) is not None:
            match, after, self._oldest_at_s = row
            if self._failure is None:
                try:
                    self._store.count_match(self._name, match, after)
                except ArenaError as error:
                    self._failure = error
            self._oldest_at_s = None


@contextmanager
def open_ladder(db: str, pit: str, rules_hash: str) -> Iterator[RatedLadder]:
    """Keep the ladder of a pit in the store at `db`, as long as nobody else does, and its rules are what they were."""
    with LadderStore(db) as store, store.keep(pit):
        before = store.find_rules(pit)
        if before not in (None, rules_hash):
            raise StoreError(
                f"the ladder of {pit} is played under other rules ({str(before)[:8]}, these are {rules_hash[:8]}); "
                "choose another name with --pit"
            )
        ladder = RatedLadder(store, pit)
        try:
            yield ladder
        finally:
            ladder.close()
