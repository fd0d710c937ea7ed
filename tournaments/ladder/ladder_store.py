"""Ladders in the store: each match counted once, and with it, in one transaction, what it made of two ratings."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Connection, func, select

from arena.errors import ArenaError
from arena.game.types import Team
from arena.pit.ladder import LadderMatch
from arena.protocol.identity import to_text
from tournaments.ladder.skill import LadderEntry
from tournaments.store.schema import LADDER_ENTRIES, LADDER_MATCHES, StoreError
from tournaments.store.store import Store, TakenError

_FIELDS = ("key", "name", "mu", "sigma", "wins", "draws", "losses", "forfeits", "n_blue", "version", "played_at")


class TakenLadderError(ArenaError):
    """Another pit keeps the ladder."""

    def __init__(self, ladder: str) -> None:
        super().__init__(f"another pit of the name {ladder} keeps its ladder in this store; choose another name with --pit")
        self.ladder = ladder


class LadderStore(Store):
    """A store, as ladders see it. A ladder is called what its pit is called."""

    @contextmanager
    def keep(self, ladder: str) -> Iterator[None]:
        """Keep every other pit off a ladder; its lock is one that no league can have."""
        try:
            with self.lock(_lock_of(ladder)):
                yield
        except TakenError as error:
            raise TakenLadderError(ladder) from error

    def entries(self, ladder: str) -> list[LadderEntry]:
        """Return everyone on a ladder."""
        query = select(*(LADDER_ENTRIES.c[name] for name in _FIELDS)).where(LADDER_ENTRIES.c.ladder == ladder)
        rows = self._do("read", lambda connection: connection.execute(query).all())
        return [LadderEntry(**row._mapping) for row in rows]

    def counted(self, ladder: str) -> set[str]:
        """Return the identities of the matches that were counted."""
        query = select(LADDER_MATCHES.c.identity).where(LADDER_MATCHES.c.ladder == ladder)
        return self._do("read", lambda connection: set(connection.scalars(query)))

    def find_rules(self, ladder: str) -> str | None:
        """Return the hash of the rules that a ladder is played under; None if nothing was played."""
        query = select(LADDER_MATCHES.c.rules).where(LADDER_MATCHES.c.ladder == ladder).limit(1)
        return self._do("read", lambda connection: connection.scalar(query))

    def ladders(self) -> list[str]:
        """Return all ladders, the one on which a match was counted last first."""
        last = func.max(LADDER_MATCHES.c.id)
        query = select(LADDER_MATCHES.c.ladder).group_by(LADDER_MATCHES.c.ladder).order_by(last.desc())
        return self._do("read", lambda connection: list(connection.scalars(query)))

    def latest_ladder(self) -> str:
        """Return the ladder on which a match was counted last."""
        ladders = self.ladders()
        if not ladders:
            raise StoreError("the store holds no ladder yet; arena serve --ladder begins one")
        return ladders[0]

    def count_match(
        self, ladder: str, match: LadderMatch, after: dict[Team, LadderEntry], counted_at: float | None = None
    ) -> bool:
        """Keep a match, counted at a time, else now, and its two entries as they are after it.

        False if it was counted before, which changes nothing.
        """
        row = {
            "ladder": ladder,
            "identity": match.identity,
            "blue": match.names[Team.BLUE],
            "red": match.names[Team.RED],
            "blue_key": to_text(match.entries[Team.BLUE]),
            "red_key": to_text(match.entries[Team.RED]),
            **match.result.to_dict(),
            "rules": match.rules_hash,
            "counted_at": time.time() if counted_at is None else counted_at,
        }
        keep = self._insert(LADDER_MATCHES).values(row).on_conflict_do_nothing(index_elements=["identity"]).inline()
        changes = []
        for entry in after.values():
            values = {name: getattr(entry, name) for name in _FIELDS}
            change = self._insert(LADDER_ENTRIES).values(ladder=ladder, **values)
            changes.append(change.on_conflict_do_update(index_elements=["ladder", "key"], set_=values))

        def work(connection: Connection) -> bool:
            if connection.execute(keep.execution_options(preserve_rowcount=True)).rowcount != 1:
                return False
            for change in changes:
                connection.execute(change)
            return True

        return self._do("write to", work, _lock_of(ladder))


def _lock_of(ladder: str) -> str:
    return f"{ladder}.ladder"
