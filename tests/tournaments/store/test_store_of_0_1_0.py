"""A store that arena 0.1.0 made, before there were ladders, seasons and versions: upgraded, with the report that it had then.

`autumn_of_0_1_0.sql` and `.json` are of the code of that time: its store after a league of three, and what its `arena tournament
report --format json` printed.
"""

import json
import sqlite3
import subprocess
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from outcomes import ended
from sqlalchemy import text

from tournaments.store.migrations.upgrade import lay
from tournaments.store.schema import reach
from tournaments.store.store import Store

SQL = Path(__file__).with_name("autumn_of_0_1_0.sql").read_text()
REPORT = json.loads(Path(__file__).with_name("autumn_of_0_1_0.json").read_text())


@pytest.fixture
def old_url(store_url: str) -> str:
    """Return the old store, on each database."""
    if store_url.startswith("sqlite"):
        with closing(sqlite3.connect(store_url.removeprefix("sqlite:///"))) as database:
            database.executescript(SQL)
        return store_url
    engine = reach(store_url, must_exist=False)[0]
    rows = [line for line in SQL.splitlines() if line.startswith("INSERT") and "alembic_version" not in line]
    with engine.connect() as connection, connection.begin():
        lay(connection, "0001")
        for row in rows:
            connection.exec_driver_sql(row.replace("%", "%%"))
        for table in ("leagues", "matches"):  # as if it had numbered them itself
            connection.execute(text(f"SELECT setval('{table}_id_seq', (SELECT max(id) FROM {table}))"))
    engine.dispose()
    return store_url


def test_a_store_of_0_1_0_has_the_report_that_it_had_then(
    old_url: str, here: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    done = here("tournament", "report", "autumn", "--format", "json", "--db", old_url, "--data", tmp_path)

    report = json.loads(done.stdout)
    assert done.returncode == 0, done.stderr
    parts = ("matches", "standings", "cross", "side", "draw_rate")
    assert {part: report[part] for part in parts} == {part: REPORT[part] for part in parts}
    then = {name: fact for name, fact in REPORT["league"].items() if name != "secret"}  # which is told once a league is closed
    assert {name: report["league"][name] for name in then} == then


def test_a_store_of_0_1_0_keeps_its_results_and_goes_on(old_url: str) -> None:
    with Store(old_url) as store:
        league = store.get("autumn")
        before = store.outcomes(league)
        raised = store.enter("autumn", league.definition, 3)
        assert store.add(raised, ended("autumn/patrol/rush/0002/rush-blue/0", "rush", "patrol", seats={}))

    with Store(old_url, make=False) as store:
        after = store.outcomes(store.get("autumn"))
    assert len(before) == 12
    assert [outcome for outcome in after if outcome.identity != "autumn/patrol/rush/0002/rush-blue/0"] == before
    assert len(after) == 13
