"""From an empty folder to a bot's row in a league's table, by the very commands that `arena new` names."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

Arena = Callable[..., subprocess.CompletedProcess[str]]


def test_five_commands_lead_from_an_empty_folder_to_a_row_in_a_table(
    arena: Arena, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))  # the user's own
    monkeypatch.chdir(tmp_path)

    new = arena("new", "mybot")
    assert new.returncode == 0, new.stderr
    assert "    cd mybot\n    arena check bot.py\n    arena tournament run league.toml\n" in new.stdout
    monkeypatch.chdir("mybot")
    league = Path("league.toml").read_text()
    fewer = league.replace("pairs = 5", "pairs = 1").replace('patrol = "patrol"\nrandom = "random"\n', "")
    Path("league.toml").write_text(fewer)
    check = arena("check", "bot.py")
    assert check.returncode == 0, check.stdout + check.stderr
    ran = arena("tournament", "run", "league.toml")
    assert ran.returncode == 0, ran.stderr
    board = arena("leaderboard", "--json")

    rows = {row["entry"]: row for row in json.loads(board.stdout)["standings"]}
    assert set(rows) == {"mybot", "rush"}
    assert rows["mybot"]["wins"] + rows["mybot"]["draws"] + rows["mybot"]["losses"] == 2
    assert rows["mybot"]["forfeits"] == 0
