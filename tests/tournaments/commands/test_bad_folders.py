"""Folders in which nothing can be written, and files where folders should be: one sentence, and exit 2."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.network.address import free_port
from tournaments.store.store import Store

Run = Callable[..., subprocess.CompletedProcess[str]]
LEAGUE = 'name = "cup"\npairs = 1\nseed = 3\nentries = ["rush", "random"]\n'


@pytest.fixture
def league(tmp_path: Path) -> Path:
    path = tmp_path / "cup.toml"
    path.write_text(LEAGUE)
    return path


def put_file(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("")


def check(done: subprocess.CompletedProcess[str], sentence: str) -> None:
    assert done.returncode == 2, done.stderr
    assert sentence in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("blocked", "sentence"),
    [
        ("journals", "cannot lock the league with"),
        ("journals/cup", "cannot use {}/journals/cup for data: it is no folder"),
        ("keys", "cannot make the key file"),
    ],
)
def test_a_league_without_its_folders_is_one_sentence(
    here: Run, league: Path, tmp_path: Path, blocked: str, sentence: str
) -> None:
    put_file(tmp_path / blocked)

    check(here("tournament", "run", league, "--venue", "network", "--data", tmp_path), sentence.format(tmp_path))


def test_a_home_that_is_no_folder_is_one_sentence(here: Run, league: Path, tmp_path: Path) -> None:
    put_file(tmp_path / "homes")

    check(here("tournament", "run", league, "--venue", "network", "--data", tmp_path), "for data: Not a directory")


def test_a_pit_whose_journals_lie_nowhere_is_one_sentence(here: Run, tmp_path: Path) -> None:
    serve = "serve", "--listen", f"tcp/127.0.0.1:{free_port()}", "--matches", 1, "--data", tmp_path
    put_file(tmp_path / "journals")
    check(here(*serve), f"cannot use {tmp_path}/journals for data: it is no folder")

    (tmp_path / "journals").unlink()
    (tmp_path / "journals" / ".lock").mkdir(parents=True)  # refused like one on a disk that is read alone
    check(here(*serve), f"cannot keep journals in {tmp_path}/journals: Is a directory")


@pytest.mark.parametrize("facts", ["", "{", "null", "[[[", "3"])
def test_a_league_whose_row_was_changed_is_one_sentence(here: Run, tmp_path: Path, facts: str) -> None:
    with Store(str(tmp_path / "arena.db")) as store:
        store.enter("cup", {"ruleset": "paper", "rules": "1", "entries": {}, "clock": {}}, 1)
    change(tmp_path / "arena.db", "UPDATE leagues SET facts = ?", facts)

    for command in ("tournament status", "leaderboard"):
        check(here(*command.split(), "--data", tmp_path), "the row of the league cup in the store")


@pytest.mark.parametrize(
    ("column", "value"),
    [("seats", "{"), ("seats", '{"green": {}}'), ("seats", '{"blue": {"a": 1}}'), ("seats", "[]"), ("ending", "boredom")],
)
def test_a_match_whose_row_was_changed_is_one_sentence(here: Run, league: Path, tmp_path: Path, column: str, value: str) -> None:
    assert here("tournament", "run", league, "--venue", "local", "--data", tmp_path).returncode == 0
    change(tmp_path / "arena.db", f"UPDATE matches SET {column} = ?", value)

    check(here("leaderboard", "--data", tmp_path), "the row of the match cup/")


def change(path: Path, statement: str, *values: str) -> None:
    """Write into a store what no store writes."""
    import sqlite3

    connection = sqlite3.connect(os.fspath(path))
    with connection:
        connection.execute(statement, values)
    connection.close()
