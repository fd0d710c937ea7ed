"""A database as the store uses it: transactions that wait for a server to come back, and locks that die with their process."""

import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock, RLock
from typing import Self, TypeVar

from sqlalchemy import Connection, Engine, func, select, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import DatabaseError

from arena.metrics.definitions import STORE_FAILURES, STORE_SECONDS, TURN_BOUNDS_S, Histogram, Reading
from tournaments.store.lock import TakenError, lock_file
from tournaments.store.migrations.upgrade import upgrade
from tournaments.store.schema import StoreError, explain, is_lost, number, reach

PATIENCE_S = 30.0
"""How long a server may be away in the middle of a league."""
T = TypeVar("T")
logger = logging.getLogger(__name__)


class Database:
    """One database, whose tables are those of this arena."""

    def __init__(self, url: str, *, make: bool = True, patience_s: float = PATIENCE_S) -> None:
        """Open a store, and with `make` lay its tables if need be; `url` is of SQLAlchemy, or a file."""
        self._engine, self._where = reach(url, must_exist=not make)
        self._insert = postgresql.insert if self._engine.dialect.name == "postgresql" else sqlite.insert
        self._patience_s = patience_s
        self._sessions: dict[str, _LockedSession] = {}
        self._counting = Lock()
        self._took = Histogram(TURN_BOUNDS_S)
        self._n_failures = 0
        try:
            with self._explaining("open"):
                upgrade(self._engine, self._where, make=make)
        except BaseException:
            self._engine.dispose()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._engine.dispose()

    @property
    def file(self) -> str | None:
        """The real path of a store in SQLite; None for one on a server, or in memory."""
        if self._engine.dialect.name == "postgresql" or self._where == ":memory:":
            return None
        where = self._where
        return os.path.realpath(where.removeprefix("file:").partition("?")[0] if where.startswith("file:") else where)

    def readings(self) -> list[Reading]:
        """Return what a monitor is told, on any thread."""
        with self._counting:
            return [Reading(STORE_SECONDS, self._took.copy()), Reading(STORE_FAILURES, self._n_failures)]

    @contextmanager
    def _explaining(self, what: str) -> Iterator[None]:
        """Raise what the database raised as one sentence."""
        try:
            yield
        except DatabaseError as error:
            raise StoreError(explain(what, self._where, error)) from error

    def _do(self, what: str, work: Callable[[Connection], T], league: str | None = None) -> T:
        """Do something in one transaction; if the server goes away, wait for it and do it again.

        What is done to a league whose lock is held is done in the session that holds it: whoever lost the lock cannot write.
        """
        give_up_at = None
        begun_s = time.monotonic()
        while True:
            try:
                session = self._sessions.get(league) if league is not None else None
                with session.use() if session is not None else self._engine.connect() as connection, connection.begin():
                    done = work(connection)
                with self._counting:
                    self._took.add([time.monotonic() - begun_s])
                return done
            except (DatabaseError, TakenError) as error:
                with self._counting:
                    self._n_failures += 1
                is_over = give_up_at is not None and time.monotonic() > give_up_at
                if isinstance(error, TakenError):
                    if give_up_at is None or is_over:  # until then, the server may not know that our old session is dead
                        raise
                elif is_over or not is_lost(error):
                    raise StoreError(explain(what, self._where, error)) from error
                elif give_up_at is None:
                    give_up_at = time.monotonic() + self._patience_s
                    said = explain(what, self._where, error)
                    logger.warning("%s; trying again for %.0f s", said, self._patience_s)
                time.sleep(0.2)

    @contextmanager
    def lock(self, league: str) -> Iterator[None]:
        """Keep every other scheduler off a league; the lock dies with its process.

        Raises
        ------
        TakenError
            Another scheduler runs the league.
        """
        if self._engine.dialect.name != "postgresql":
            if self.file is None:  # where nobody else can come
                yield
                return
            with lock_file(Path(f"{self.file}.{league}.lock"), league):
                yield
            return
        session = _LockedSession(self._engine, self._where, league)
        with self._explaining("lock a league in"), session.use():
            pass
        self._sessions[league] = session
        try:
            yield
        finally:
            del self._sessions[league]
            session.release()


class _LockedSession:
    """A league's lock in PostgreSQL, and the session that holds it; when the session dies, so does the lock."""

    def __init__(self, engine: Engine, where: str, league: str) -> None:
        self._engine, self._where, self._league = engine, where, league
        self._number = number(f"arena league {league}")
        self._one_at_a_time = RLock()
        self._connection: Connection | None = None

    @contextmanager
    def use(self) -> Iterator[Connection]:
        """Lend the session, for one thread at a time; a dead one is followed by a new one that takes the lock again."""
        with self._one_at_a_time:
            if self._connection is None or self._connection.invalidated:
                self.release()
                self._connection = self._take()
            yield self._connection

    def _take(self) -> Connection:
        connection = self._engine.connect()
        try:
            with connection.begin():
                # The server is to notice within a minute, too, that this machine vanished.
                for name, seconds in (("idle", 30), ("interval", 10), ("count", 3)):
                    connection.execute(text(f"SET tcp_keepalives_{name} = {seconds}"))
                if not connection.scalar(select(func.pg_try_advisory_lock(self._number))):
                    raise TakenError(self._league, f"its lock in {self._where}")
        except BaseException:
            connection.close()
            raise
        return connection

    def release(self) -> None:
        """Let the lock go."""
        connection, self._connection = self._connection, None
        if connection is None:
            return
        with suppress(DatabaseError):
            if not connection.invalidated:
                with connection.begin():
                    connection.execute(select(func.pg_advisory_unlock(self._number)))
        connection.close()
