"""The tables of the store from version to version, on each database: all of the way, or not at all."""

import json
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from outcomes import ended
from sqlalchemy import Engine, inspect, text

from tournaments.league.edits import find_edit
from tournaments.league.file import parse_league
from tournaments.outcome import Outcome
from tournaments.running.progress import progress_of
from tournaments.store.migrations import upgrade
from tournaments.store.schema import METADATA, reach
from tournaments.store.store import Store, StoreError

FACTS = {"ruleset": "paper", "rules": "1", "entries": {}, "clock": {}}
OUTCOME = ended("friday/0", "a", "b", seats={})
LAST = upgrade.VERSION
GROWN = """
from alembic import op
revision, down_revision = "9000", "LAST"
def upgrade():
    op.execute("ALTER TABLE leagues ADD COLUMN colour VARCHAR(9)")
    op.execute("UPDATE leagues SET colour = 'red'")
""".replace("LAST", LAST)
LATER_TABLES = (
    "alembic_version", "ladder_matches", "ladder_entries", "versions", "season_entries", "submissions", "season_standings",
)  # fmt: skip
BACK_TO_THE_FIRST = [
    *(f"DROP TABLE {name}" for name in LATER_TABLES),
    *(f"DROP INDEX ix_matches_{side}" for side in ("blue", "red")),
]
BROKEN = GROWN + "    op.execute('ALTER TABLE nowhere ADD COLUMN colour VARCHAR(9)')\n"


def fill(url: str) -> None:
    with Store(url) as store:
        assert store.add(store.enter("friday", FACTS, 1), OUTCOME)


def read(url: str) -> list[Outcome]:
    with Store(url, make=False) as store:
        return store.outcomes(store.latest())


def run(url: str, *statements: str) -> list[object]:
    """Run statements, and return the first column of what the last one finds."""
    engine: Engine = reach(url, must_exist=False)[0]
    with engine.begin() as connection:
        for statement in statements:
            result = connection.execute(text(statement))
        found = list(result.scalars()) if result.returns_rows else []
    engine.dispose()
    return found


@pytest.fixture
def newer_arena(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Pretend that this arena has one version more, and return the file of its way there."""
    scripts = tmp_path / "100% scripts"
    (scripts / "versions").mkdir(parents=True)
    shipped = files("tournaments.store.migrations")
    for source in (
        "env.py",
        *(f"versions/{path.name}" for path in (shipped / "versions").iterdir() if path.name.startswith("v0")),
    ):
        (scripts / source).write_text((shipped / source).read_text())
    (scripts / "versions" / "grown.py").write_text(GROWN)
    monkeypatch.setattr(upgrade, "_SCRIPTS", scripts)
    monkeypatch.setattr(upgrade, "VERSION", "9000")
    return scripts / "versions" / "grown.py"


def test_the_versions_lead_to_the_tables_of_the_schema(store_url: str) -> None:
    with Store(store_url) as store, store._engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []


def test_what_a_league_had_played_before_versions_came_was_the_first_version_of_its_entries(store_url: str) -> None:
    with Store(store_url) as store:
        league = store.enter("friday", {**FACTS, "entries": {"a": "rush", "b": "patrol"}}, 1)
        store.add(league, replace(OUTCOME, identity="friday/a/b/0000/a-blue/0"))
    run(store_url, *BACK_TO_THE_FIRST)

    with Store(store_url) as store:
        edited = store.enter("friday", {**FACTS, "entries": {"a": "rush", "b": "spiral"}}, 1)

        assert edited.labels == {"a": "a", "b": "b.2"}
        assert [one.label for one in store.versions(edited)] == ["a", "b", "b.2"]


def test_the_last_version_is_the_one_that_stores_are_checked_against() -> None:
    assert ScriptDirectory(str(files("tournaments.store.migrations"))).get_current_head() == upgrade.VERSION


def test_a_store_without_a_version_is_the_first_and_keeps_its_results(store_url: str) -> None:
    fill(store_url)
    run(store_url, *BACK_TO_THE_FIRST)

    assert read(store_url) == [OUTCOME]
    with Store(store_url) as store:
        assert not store.add(store.latest(), OUTCOME)
    assert run(store_url, "SELECT version_num FROM alembic_version") == [LAST]
    assert read(store_url) == [OUTCOME]


@pytest.mark.parametrize("make", [True, False])
def test_a_store_of_a_newer_arena_is_refused_and_left_as_it_is(store_url: str, make: bool) -> None:
    fill(store_url)
    run(store_url, "UPDATE alembic_version SET version_num = '9999'")

    with pytest.raises(StoreError, match="was made by a newer arena; update this one, or name another --db"):
        Store(store_url, make=make)

    assert run(store_url, "SELECT version_num FROM alembic_version") == ["9999"]
    assert run(store_url, "SELECT identity FROM matches") == ["friday/0"]


@pytest.mark.parametrize("make", [True, False])
@pytest.mark.parametrize("is_numbered", [True, False])
def test_an_older_store_is_brought_up_to_date(
    store_url: str, make: bool, is_numbered: bool, request: pytest.FixtureRequest
) -> None:
    fill(store_url)
    if not is_numbered:
        run(store_url, *BACK_TO_THE_FIRST)
    request.getfixturevalue("newer_arena")

    with Store(store_url, make=make) as store:
        assert store.outcomes(store.latest()) == [OUTCOME]

    assert run(store_url, "SELECT colour FROM leagues") == ["red"]
    assert run(store_url, "SELECT version_num FROM alembic_version") == ["9000"]


def test_an_upgrade_that_fails_leaves_the_store_as_it_was(store_url: str, newer_arena: Path) -> None:
    newer_arena.unlink()
    fill(store_url)
    newer_arena.write_text(BROKEN)

    with pytest.raises(StoreError, match="cannot open the store"):
        Store(store_url)

    engine = reach(store_url, must_exist=False)[0]
    assert "colour" not in [column["name"] for column in inspect(engine).get_columns("leagues")]
    engine.dispose()
    assert run(store_url, "SELECT version_num FROM alembic_version") == [LAST]
    assert run(store_url, "SELECT identity FROM matches") == ["friday/0"]


def test_a_database_without_tables_holds_no_results_and_gets_none_by_being_read(store_url: str) -> None:
    run(store_url, "SELECT 1")  # which makes SQLite's file

    with pytest.raises(StoreError, match="no table of leagues"):
        Store(store_url, make=False)

    engine = reach(store_url, must_exist=False)[0]
    assert inspect(engine).get_table_names() == []
    engine.dispose()


def test_a_gauntlet_that_was_stored_with_a_hero_has_a_challenger_and_goes_on(tmp_path: Path) -> None:
    """The file is of the arena before the key was renamed, with all four matches of this league; rows still hold the old name."""
    file = tmp_path / "arena.db"
    with closing(sqlite3.connect(file)) as database:
        database.executescript(Path(__file__).with_name("gauntlet_of_0002.sql").read_text())
    league = parse_league(
        'pairs = 1\nseed = 5\npairing = "gauntlet"\nchallenger = "rush"\nentries = ["rush", "patrol", "random"]', "old", tmp_path
    )

    with Store(str(file)) as store:
        before = store.get("old")
        assert progress_of(store, before) == {"league": "old", "entries": 3, "played": 4, "planned": 4, "complete": True}
        assert find_edit(before.definition, {**league.definition, "secret": before.definition["secret"]}) is None
        after = store.enter("old", {**league.definition, "secret": before.definition["secret"]}, 2)
        edited = {**before.definition, "challenger": "patrol"}
        with pytest.raises(StoreError, match="challenger was edited"):
            store.enter("old", edited, 2)

    assert before.definition["challenger"] == "rush"
    assert (after.hash, after.definition, after.n_pairs) == (before.hash, before.definition, 2)
    assert run(str(file), "SELECT facts FROM leagues") == [json.dumps(_as_stored(before.definition), sort_keys=True)]


def _as_stored(definition: Mapping[str, Any]) -> dict[str, Any]:
    return {"hero" if key == "challenger" else key: value for key, value in definition.items()}
