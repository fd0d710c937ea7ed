"""The first start on a new machine: every command that needs the rules says at once that it compiles them."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from threading import Timer

import pytest

from arena.game.ruleset import load as load_rules
from arena.local.venue import play
from policies.registry import load
from tournaments.fixture import plan_fixture

SAYS = "compiling the rules and the fighters, once: "
COMMANDS = {
    "serve": ["serve", "--listen", "tcp/127.0.0.1:0", "--data", "data"],
    "join": ["join", "--policy", "rush", "--pit", "tcp/127.0.0.1:1", "--data", "data"],
    "play": ["play", "rush", "patrol"],
    "web": ["web", "--port", "0", "--data", "data"],
    "tournament": ["tournament", "run", "starter", "--data", "data"],
    "evaluate": ["evaluate", "patrol", "--against", "random"],
    "train": ["train", "--out", "run"],
    "check": ["check", "rush"],
    "new": ["new", "mybot"],
    "gauntlet": ["gauntlet", "rush"],
    "debug": ["debug", "kept.journal", "--policy", "random", "--team", "blue"],
    "show": ["replay", "show", "kept.journal"],
    "verify": ["replay", "verify", "--local", "kept.journal"],
    "export": ["replay", "export", "--gif", "kept.journal"],
}


def first_line(folder: Path, *arguments: str) -> str:
    """Start a command with an empty cache, and return the first line that it says on stderr; then it is ended."""
    command = [sys.executable, "-c", "from tournaments.cli import main; main()", *arguments]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    give_up = Timer(120, process.kill)
    give_up.start()
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
    finally:
        give_up.cancel()
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    return line


@pytest.fixture(scope="module")
def journal(compiled: None) -> bytes:
    """A match to be looked at."""
    plan = plan_fixture("kept", "one", "two", 1, bytes(32))[0]
    record = next(play(load_rules("paper").with_({"tick_limit": 2}), [plan], lambda _: load("random"), n_workers=1))
    assert record.journal is not None
    return record.journal


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_a_command_says_that_it_compiles_before_it_does(tmp_path: Path, command: list[str], journal: bytes) -> None:
    (tmp_path / "kept.journal").write_bytes(journal)

    line = first_line(tmp_path, *command)

    assert line.startswith(SAYS), line
    assert not list(tmp_path.rglob("play-*.kernel")), "it was said when all was done"


def test_a_league_says_so_to_a_program_as_json(tmp_path: Path) -> None:
    facts = json.loads(first_line(tmp_path, "tournament", "run", "starter", "--data", "data", "--progress", "json"))

    assert facts["event"] == "compiling"
    assert facts["kernels"] > 4
    assert facts["expected_s"] > 0
