"""A whole store as lines of JSON, and back: the same from SQLite and from PostgreSQL, so that either can become the other."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any

from sqlalchemy import Connection, MetaData, Table, func, insert, select
from sqlalchemy.exc import DatabaseError

from tournaments.store.migrations.upgrade import find_version, lay
from tournaments.store.schema import AT_ONCE, METADATA, StoreError, explain, reach
from tournaments.store.store import Store

_MOST_ROWS = 1_000
"""Rows that are read or written at once."""
TableLines = tuple[str, Iterable[bytes]]
"""A table's name, and its lines: the names of its columns, then a row each."""


class CopiedStore(Store):
    """A store, as whoever copies it sees it."""

    @contextmanager
    def tables(self) -> Iterator[tuple[str, Iterator[TableLines]]]:
        """Lend the version of the tables, and all of them as they stand at one moment, whatever is written meanwhile."""
        with self._explaining("read"), self._engine.connect() as connection:
            if connection.dialect.name == "postgresql":
                connection = connection.execution_options(isolation_level="REPEATABLE READ")
            with connection.begin():
                yield str(find_version(connection)), ((table.name, _lines(connection, table)) for table in METADATA.sorted_tables)


def _lines(connection: Connection, table: Table) -> Iterator[bytes]:
    yield _line(table.columns.keys())
    query = select(table).order_by(*table.primary_key)
    for rows in connection.execution_options(yield_per=_MOST_ROWS).execute(query).partitions():
        yield from (_line(list(row)) for row in rows)


def _line(values: list[Any]) -> bytes:
    return json.dumps(values, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def fill(url: str, version: str, tables: Iterable[TableLines]) -> int:
    """Make a store of what `CopiedStore.tables` gave, bring it up to date, and return how many rows it has: all of them, or none.

    Raises
    ------
    StoreError
        There is a store already, or what was given is of a newer arena.
    InputError
        Lines are not what a store has.
    """
    engine, where = reach(url, must_exist=False)
    try:
        with engine.connect().execution_options(**AT_ONCE) as connection, connection.begin():
            if find_version(connection) is not None:
                raise StoreError(f"there is a store at {where} already; restore into one that is empty, with another --db")
            lay(connection, version)
            n_rows = sum(_fill(connection, name, lines) for name, lines in tables)
            lay(connection, "head")
            return n_rows
    except DatabaseError as error:
        raise StoreError(explain("restore", where, error)) from error
    finally:
        engine.dispose()


def _fill(connection: Connection, name: str, lines: Iterable[bytes]) -> int:
    table = Table(name, MetaData(), autoload_with=connection)
    rows = (json.loads(line) for line in lines)
    columns = next(rows)
    n_rows = 0
    while some := [dict(zip(columns, row, strict=True)) for row in islice(rows, _MOST_ROWS)]:
        connection.execute(insert(table), some)
        n_rows += len(some)
    if n_rows and connection.dialect.name == "postgresql":  # which numbers rows by a counter that nobody moved
        for column in table.primary_key:
            counter = func.pg_get_serial_sequence(name, column.name)
            connection.execute(select(func.setval(counter, select(func.max(column)).scalar_subquery())))
    return n_rows
