"""The database behind the store: its tables, how it is reached, and what it says, in one sentence."""

import os
import re
import sqlite3
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sqlalchemy import (
    URL,
    Boolean,
    Column,
    Connection,
    Double,
    Engine,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
    create_engine,
    event,
    make_url,
)  # fmt: skip
from sqlalchemy.exc import ArgumentError, DBAPIError

from arena.errors import InputError

_LABEL = String(64).with_variant(String(72), "postgresql")
"""Of a version: once it was the name of an entry. SQLite does not mind how long a text is, and kept its table."""
METADATA = MetaData()
"""What the last of `migrations/versions/` leads to."""
LEAGUES = Table(
    "leagues",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", String(64), nullable=False, unique=True),
    Column("hash", String(64), nullable=False),
    Column("facts", Text, nullable=False),
    Column("n_pairs", Integer, nullable=False),
    Column("run_at", Float, nullable=False),
)
MATCHES = Table(
    "matches",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("league_id", ForeignKey("leagues.id"), nullable=False, index=True),
    Column("identity", String(300), nullable=False, unique=True),
    Column("blue", _LABEL, nullable=False),
    Column("red", _LABEL, nullable=False),
    Column("ending", String(16), nullable=False),
    Column("winner", String(4)),
    Column("score", Integer, nullable=False),
    Column("ticks", Integer, nullable=False),
    Column("reason", Text, nullable=False),
    Column("seats", Text, nullable=False),
    Index("ix_matches_blue", "league_id", "blue"),
    Index("ix_matches_red", "league_id", "red"),
)
VERSIONS = Table(
    "versions",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("league_id", ForeignKey("leagues.id"), nullable=False),
    Column("entry", String(64), nullable=False),
    Column("number", Integer, nullable=False),
    Column("fingerprint", Text, nullable=False),
    Column("entered_at", Double, nullable=False),
    Column("spec", Text, nullable=False),
    Column("rating", Text),
    UniqueConstraint("league_id", "entry", "number"),
)
SEASON_ENTRIES = Table(
    "season_entries",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("league_id", ForeignKey("leagues.id"), nullable=False),
    Column("entry", String(64), nullable=False),
    Column("owner", String(64), nullable=False),
    Column("number", Integer, nullable=False),
    Column("is_withdrawn", Boolean, nullable=False),
    UniqueConstraint("league_id", "entry"),
)
SUBMISSIONS = Table(
    "submissions",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("league_id", ForeignKey("leagues.id"), nullable=False, index=True),
    Column("entry", String(64), nullable=False),
    Column("owner", String(64), nullable=False),
    Column("digest", String(64), nullable=False),
    Column("n_bytes", Integer, nullable=False),
    Column("received_at", Double, nullable=False),
    Column("state", String(16), nullable=False),
    Column("says", Text, nullable=False),
    Column("report", Text),
    Column("number", Integer),
)
SEASON_STANDINGS = Table(
    "season_standings",
    METADATA,
    Column("league_id", ForeignKey("leagues.id"), primary_key=True),
    Column("made_at", Double, nullable=False),
    Column("document", Text, nullable=False),
)
LADDER_ENTRIES = Table(
    "ladder_entries",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("ladder", String(64), nullable=False),
    Column("key", String(64), nullable=False),
    Column("name", String(64), nullable=False),
    Column("mu", Double, nullable=False),
    Column("sigma", Double, nullable=False),
    Column("wins", Integer, nullable=False),
    Column("draws", Integer, nullable=False),
    Column("losses", Integer, nullable=False),
    Column("forfeits", Integer, nullable=False),
    Column("n_blue", Integer, nullable=False),
    Column("version", String(64), nullable=False, server_default=""),
    Column("played_at", Double, nullable=False, server_default="0"),
    UniqueConstraint("ladder", "key"),
)
LADDER_MATCHES = Table(
    "ladder_matches",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("ladder", String(64), nullable=False, index=True),
    Column("identity", String(300), nullable=False, unique=True),
    Column("blue", String(64), nullable=False),
    Column("red", String(64), nullable=False),
    Column("blue_key", String(64), nullable=False),
    Column("red_key", String(64), nullable=False),
    Column("ending", String(16), nullable=False),
    Column("winner", String(4)),
    Column("score", Integer, nullable=False),
    Column("ticks", Integer, nullable=False),
    Column("reason", Text, nullable=False),
    Column("rules", String(64), nullable=False),
    Column("counted_at", Double, nullable=False),
)

AT_ONCE = {"arena_at_once": True}
"""Option of a connection: it takes SQLite's write lock when its transaction begins, not at its first write."""
_BUSY_S = 30.0
"""How long SQLite waits for another process to end its transaction."""
_POSTGRESQL: dict[str, Any] = {
    "connect_timeout": 10,  # s
    "keepalives_idle": 10,  # s; a server that vanished without a word is noticed after 25 s
    "keepalives_interval": 5,
    "keepalives_count": 3,
    "tcp_user_timeout": 25_000,  # ms
    "application_name": "arena",
}
_ADVICE = (
    ("password", "correct the user or the password in its URL, or in PGPASSWORD"),
    (r'role ".*" does not exist', "correct the user in its URL"),
    (r'database ".*" does not exist', "make it with createdb, or name another --db"),
    ("permission denied", "its owner must let this user in, and make tables there"),
    ("readonly|read-only", "it can be read, and nothing in it is lost; to write, name another --db"),
    ("full|no space|disk i/o", "make room on its disk and run this again; nothing that was stored is lost"),
    ("locked", "another program writes to it; run this again when that is done"),
    ("unable to open", "its folder must be there, and let you write"),
    ("not a database|malformed", "name another --db"),
    (
        "refused|resolve|time|no such file|no route|unreachable|starting up|recovery|shutting down|shutdown|closed|terminat",
        "its server must run, and let itself be reached from here",
    ),
    ("too many", "its server has too many guests; run this again later"),
)
_LOST = re.compile("08|57P|53300")
"""States of SQL in which a server is away for a while, or has no room for a guest."""


class StoreError(InputError):
    """The store cannot be read or written; nothing that it holds is lost."""


def reach(url: str, *, must_exist: bool) -> tuple[Engine, str]:
    """Return the database at a URL, or in a file, not yet connected; and what to call it, without a password.

    Raises
    ------
    StoreError
        It is no place where a store can be.
    """
    is_file = "://" not in url and (":" not in url or "/" in url)
    try:
        parsed = URL.create("sqlite", database=url) if is_file else make_url(url)
    except (ArgumentError, ValueError) as error:
        shown = re.sub("//.*@", "//***@", url)
        raise StoreError(f"--db is {shown!r}; it must be a file, or a URL like postgresql://user@host/database") from error
    kind = parsed.get_backend_name()
    if kind == "sqlite":
        return _reach_sqlite(parsed, must_exist=must_exist)
    if kind in ("postgresql", "postgres"):
        return _reach_postgresql(parsed)
    raise StoreError(f"the store cannot be kept in {kind}; name a file, or a URL like postgresql://user@host/database")


def _reach_sqlite(url: URL, *, must_exist: bool) -> tuple[Engine, str]:
    where = url.database or ":memory:"
    file = Path(where)
    if must_exist and not file.exists() and not where.startswith("file:"):
        raise StoreError(f"there are no results yet: there is no {where}")
    if file.is_file() and not os.access(file.parent, os.W_OK) and not Path(f"{where}-wal").exists():
        # The WAL's two files cannot be made here, and nobody is at work with them: read without.
        url = url.set(database=f"file:{quote(str(file.absolute()))}", query={"immutable": "1", "uri": "true"})
    engine = create_engine(url, connect_args={"timeout": _BUSY_S})

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _: object) -> None:
        connection.isolation_level = None  # transactions begin below, so that they hold changes of tables, too
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = NORMAL")  # outlives the process; a power cut may cost the last results
        if os.access(where, os.W_OK) or not file.exists():
            with suppress(sqlite3.OperationalError):  # another process sets it right now, or the disk cannot do it
                connection.execute("PRAGMA journal_mode = WAL")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        at_once = AT_ONCE.items() <= connection.get_execution_options().items()
        connection.exec_driver_sql("BEGIN IMMEDIATE" if at_once else "BEGIN")

    return engine, where


def _reach_postgresql(url: URL) -> tuple[Engine, str]:
    given = {key: value for key, value in _POSTGRESQL.items() if key not in url.query}
    try:
        engine = create_engine(
            url.set(drivername="postgresql+psycopg"), connect_args=given, pool_pre_ping=True, isolation_level="READ COMMITTED"
        )
    except ImportError as error:
        raise StoreError(
            "a store in PostgreSQL needs psycopg, which is not installed here: pip install 'arena-pit[postgres]'"
        ) from error
    return engine, url.set(drivername="postgresql", password=None, query={}).render_as_string()


def explain(what: str, where: str, error: DBAPIError) -> str:
    """Return in one sentence what a database said, and what to do."""
    said = str(error.orig or error).strip().partition("\n")[0]
    reason = re.sub(r"^.* failed: (?=\S)|FATAL: *", "", said)
    advice = next((advice for pattern, advice in _ADVICE if re.search(pattern, reason.lower())), None)
    return f"cannot {what} the store {where}: {reason}" + (f"; {advice}" if advice else "")


def is_lost(error: DBAPIError) -> bool:
    """Whether a server went away in the middle of something, or is not there yet: it may come back."""
    if error.connection_invalidated:
        return True
    if isinstance(error.orig, sqlite3.Error):
        return False
    state: str | None = getattr(error.orig, "sqlstate", None)
    return _LOST.match(state) is not None if state else type(error.orig).__name__ == "OperationalError"


def number(name: str) -> int:
    """Return the number by which PostgreSQL knows a lock."""
    return int.from_bytes(sha256(name.encode()).digest()[:8], "big", signed=True)
