"""Bring the tables of a store to the version of this arena: all of the way in one transaction, or not at all."""

from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from sqlalchemy import Connection, Engine, func, inspect, select, text

from tournaments.store.schema import AT_ONCE, StoreError, number

if TYPE_CHECKING:
    from alembic.config import Config

VERSION = "0004"
"""The last of `versions/`. Most stores have it, and are opened without alembic, whose import takes half a second."""
_FIRST = "0001"
"""What a store without a version is of: the arena once laid its tables without alembic."""
_UNNUMBERED = ""
_SCRIPTS = Path(__file__).parent
_ONE_AT_A_TIME = Lock()  # alembic keeps its context in a module


def upgrade(engine: Engine, where: str, *, make: bool) -> None:
    """Bring a store up to date, and with `make` lay its tables where there are none.

    Raises
    ------
    StoreError
        There are no tables, or they are of a newer version.
    """
    with engine.connect() as connection:
        version = find_version(connection)
    if version is None and not make:
        raise StoreError(f"{where} is no store of the arena: it has no table of leagues")
    if version == VERSION or (version == _UNNUMBERED and VERSION == _FIRST and not make):
        return
    with _ONE_AT_A_TIME, engine.connect() as connection:
        _upgrade(connection.execution_options(**AT_ONCE), where)


def _upgrade(connection: Connection, where: str) -> None:
    from alembic import command
    from alembic.script import ScriptDirectory

    with connection.begin():
        if connection.dialect.name == "postgresql":
            connection.execute(select(func.pg_advisory_xact_lock(number("arena upgrade"))))
        version = find_version(connection)  # anew: another process may just have done it
        config = _configure(connection)
        known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
        if version and version not in known:
            raise StoreError(f"the store {where} was made by a newer arena; update this one, or name another --db")
        if version == _UNNUMBERED:
            command.stamp(config, _FIRST)
        command.upgrade(config, "head")


def lay(connection: Connection, version: str) -> None:
    """Bring the tables of a transaction to a version; `StoreError` if this arena does not know it."""
    from alembic import command
    from alembic.script import ScriptDirectory

    with _ONE_AT_A_TIME:
        config = _configure(connection)
        known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
        if version not in (*known, "head"):
            raise StoreError(f"the backup is of version {version} of the store, by a newer arena; update this one")
        command.upgrade(config, version)


def _configure(connection: Connection) -> "Config":
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(_SCRIPTS).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config


def find_version(connection: Connection) -> str | None:
    """Return the version of a store's tables; None if it has no tables."""
    tables = inspect(connection)
    if tables.has_table("alembic_version"):
        found = connection.scalar(text("SELECT version_num FROM alembic_version"))
        if found is not None:
            return str(found)
    return _UNNUMBERED if tables.has_table("leagues") else None
