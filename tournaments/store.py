"""Results in SQL, each match once: what is in here is never played again.

Tables: `leagues`, a row of facts each; `matches`, a row for each match that ended, its identity unique. SQLite in WAL mode, so
that reports can be read while a league runs. A commit reaches the system at once: a killed process loses nothing.
"""

import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import (
    Column,
    Engine,
    Float,
    ForeignKey,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    create_engine,
    event,
    func,
    inspect,
    select,
)  # fmt: skip
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DatabaseError, NoSuchModuleError

from arena.errors import ArenaError, InputError, UnknownNameError
from arena.game.types import Ending, Team
from tournaments.edits import find_edit, hash_facts
from tournaments.outcome import Outcome, SeatOutcome

_METADATA = MetaData()
_LEAGUES = Table(
    "leagues",
    _METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", String(64), nullable=False, unique=True),
    Column("hash", String(64), nullable=False),
    Column("facts", Text, nullable=False),
    Column("n_pairs", Integer, nullable=False),
    Column("run_at", Float, nullable=False),
)
_MATCHES = Table(
    "matches",
    _METADATA,
    Column("id", Integer, primary_key=True),
    Column("league_id", ForeignKey("leagues.id"), nullable=False, index=True),
    Column("identity", String(300), nullable=False, unique=True),
    Column("blue", String(64), nullable=False),
    Column("red", String(64), nullable=False),
    Column("ending", String(16), nullable=False),
    Column("winner", String(4)),
    Column("score", Integer, nullable=False),
    Column("ticks", Integer, nullable=False),
    Column("reason", Text, nullable=False),
    Column("seats", Text, nullable=False),
)


class StoreError(InputError):
    """The store cannot be read or written; nothing that it holds is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredLeague:
    """A league as its results were played under."""

    id: int
    name: str
    hash: str
    facts: Mapping[str, Any]
    """`League.facts`, and under `secret` what binds it to its secret."""
    n_pairs: int


class Store:
    """The results of all leagues in one database."""

    def __init__(self, url: str, *, make: bool = True) -> None:
        """Open a store, and with `make` lay its tables if need be; `url` is of SQLAlchemy, or a file."""
        try:
            parsed = make_url(url if ":" in url else f"sqlite:///{url}")
        except ArgumentError as error:
            raise StoreError(f"--db is {url!r}; it must be a file, or a URL like sqlite:////folder/arena.db") from error
        if parsed.get_backend_name() != "sqlite":
            raise StoreError(
                f"the store cannot be kept in {parsed.get_backend_name()}; name a file, or sqlite:////folder/arena.db"
            )
        self._where = parsed.database or ":memory:"
        if not make and not Path(self._where).exists() and not self._where.startswith("file:"):
            raise StoreError(f"there are no results yet: there is no {self._where}")
        self._engine = _connect(parsed, self._where)
        with self._saying("open"):
            if make:
                _METADATA.create_all(self._engine)
            elif not inspect(self._engine).has_table("leagues"):
                raise StoreError(f"{self._where} is no store of the arena: it has no table of leagues")

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self._engine.dispose()

    @contextmanager
    def _saying(self, what: str) -> Iterator[None]:
        """Turn what the database says into one sentence."""
        try:
            yield
        except (DatabaseError, NoSuchModuleError) as error:
            reason = str(getattr(error, "orig", None) or error).partition("\n")[0]
            raise StoreError(f"cannot {what} the store {self._where}: {reason}") from error

    @contextmanager
    def lock(self, league: str) -> Iterator[None]:
        """Keep every other scheduler off a league; the lock dies with its process.

        Raises
        ------
        ArenaError
            Another scheduler runs the league.
        """
        path = Path(f"{self._where.removeprefix('file:').partition('?')[0]}.{league}.lock")
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise StoreError(f"cannot lock the league with {path}: {error.strerror}") from error
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise ArenaError(f"another scheduler runs league {league} (it holds {path})") from error
            yield
        finally:
            os.close(descriptor)

    def enter(self, name: str, facts: Mapping[str, Any], n_pairs: int) -> StoredLeague:
        """Return the row of a league that is about to be run, made if need be.

        Raises
        ------
        StoreError
            It has results that were played under other facts, or more pairs; the sentence names the edit.
        """
        before = self.find(name)
        if before is not None and self.count(before) > 0:
            edit = find_edit(before.facts, facts)
            if edit is None and n_pairs < before.n_pairs:
                edit = f"pairs were lowered (were {before.n_pairs}, are {n_pairs})"
            if edit is not None:
                raise StoreError(f"league {name} has results, and {edit}: undo that, or give the league another name")
        values = {
            "hash": hash_facts(facts), "facts": json.dumps(facts, sort_keys=True), "n_pairs": n_pairs, "run_at": time.time(),
        }  # fmt: skip
        row = insert(_LEAGUES).values(name=name, **values)
        with self._saying("write to"), self._engine.begin() as connection:
            connection.execute(row.on_conflict_do_update(index_elements=["name"], set_=values))
        found = self.find(name)
        if found is None:
            raise StoreError(f"league {name} was taken out of the store while it began")
        return found

    def find(self, name: str) -> StoredLeague | None:
        """Return a league by its name."""
        rows = self._leagues(select(_LEAGUES).where(_LEAGUES.c.name == name))
        return rows[0] if rows else None

    def get(self, name: str) -> StoredLeague:
        """Return a league by its name, or refuse, naming the nearest."""
        found = self.find(name)
        if found is None:
            self.latest()
            raise UnknownNameError(f"league in {self._where}", name, [league.name for league in self.leagues()])
        return found

    def latest(self) -> StoredLeague:
        """Return the league that was run last."""
        leagues = self.leagues()
        if not leagues:
            raise StoreError(f"the store {self._where} holds no league yet; arena tournament run plays one")
        return leagues[0]

    def leagues(self) -> list[StoredLeague]:
        """Return every league, the one that was run last first."""
        return self._leagues(select(_LEAGUES).order_by(_LEAGUES.c.run_at.desc(), _LEAGUES.c.id.desc()))

    def _leagues(self, query: Any) -> list[StoredLeague]:
        with self._saying("read"), self._engine.connect() as connection:
            rows = connection.execute(query).all()
        return [
            StoredLeague(id=row.id, name=row.name, hash=row.hash, facts=json.loads(row.facts), n_pairs=row.n_pairs)
            for row in rows
        ]

    def add(self, league: StoredLeague, outcome: Outcome) -> bool:
        """Keep a match that ended; False if it was kept before. A void match is no result and is refused."""
        if outcome.ending in (Ending.VOID, Ending.RUNNING):
            raise ValueError(f"{outcome.identity} is {outcome.ending.name.lower()}, which is no result")
        row = {
            "league_id": league.id,
            "identity": outcome.identity,
            "blue": outcome.blue,
            "red": outcome.red,
            "ending": outcome.ending.name.lower(),
            "winner": None if outcome.winner is None else outcome.winner.name.lower(),
            "score": outcome.score,
            "ticks": outcome.ticks,
            "reason": outcome.reason,
            "seats": json.dumps({team.name.lower(): _pack(seat) for team, seat in sorted(outcome.seats.items())}),
        }
        with self._saying("write to"), self._engine.begin() as connection:
            return connection.execute(_KEEP, row).rowcount == 1

    def outcomes(self, league: StoredLeague) -> list[Outcome]:
        """Return a league's results, sorted by identity: in whatever order they came, they are told alike."""
        query = select(_MATCHES).where(_MATCHES.c.league_id == league.id).order_by(_MATCHES.c.identity)
        with self._saying("read"), self._engine.connect() as connection:
            return [_outcome(row) for row in connection.execute(query)]

    def identities(self, league: StoredLeague) -> set[str]:
        """Return what was played."""
        with self._saying("read"), self._engine.connect() as connection:
            return set(connection.scalars(select(_MATCHES.c.identity).where(_MATCHES.c.league_id == league.id)))

    def count(self, league: StoredLeague) -> int:
        """Return how many results a league has."""
        query = select(func.count()).where(_MATCHES.c.league_id == league.id)
        with self._saying("read"), self._engine.connect() as connection:
            return int(connection.scalar(query) or 0)


_KEEP = insert(_MATCHES).on_conflict_do_nothing(index_elements=["identity"])


def _connect(url: Any, where: str) -> Engine:
    engine = create_engine(url)

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _: object) -> None:
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = NORMAL")  # outlives the process; a power cut may cost the last results
        if os.access(where, os.W_OK) or not Path(where).exists():
            connection.execute("PRAGMA journal_mode = WAL")

    return engine


def _pack(seat: SeatOutcome) -> dict[str, Any]:
    return {"faults": seat.faults, "latency_p50_s": seat.latency_p50_s, "latency_p99_s": seat.latency_p99_s}


def _outcome(row: Any) -> Outcome:
    return Outcome(
        identity=row.identity,
        blue=row.blue,
        red=row.red,
        ending=Ending[row.ending.upper()],
        winner=None if row.winner is None else Team[row.winner.upper()],
        score=row.score,
        ticks=row.ticks,
        reason=row.reason,
        seats={Team[name.upper()]: SeatOutcome(**seat) for name, seat in json.loads(row.seats).items()},
    )
