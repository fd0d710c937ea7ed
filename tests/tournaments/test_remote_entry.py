"""An entry that joins by itself, by its key, in a league of the network."""

import json
import os
import shlex
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

from arena.game.ruleset import load
from arena.keyring.files import make
from arena.referee.match import Terms
from tournaments.venues import Setting, address_of, invitations, near

ARENA = [sys.executable, "-c", "from arena.cli import main; main()"]
PATIENCE_S = 120


def test_a_remote_entry_joins_a_league_at_the_address_that_it_is_told(tmp_path: Path) -> None:
    key, data = tmp_path / "far.key", tmp_path / "data"
    public = make(key).fingerprint
    file = tmp_path / "friday.toml"
    file.write_text(
        f'pairs = 2\nseed = 1\nmaps = "fresh"\n[rules]\ntick_limit = 10\n[entries]\nfar = "key:{public}"\nrush = "rush"\n'
    )
    run = [*ARENA, "tournament", "run", str(file), "--data", str(data), "--json"]
    league = subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    killer = threading.Timer(PATIENCE_S, league.kill)
    killer.start()
    player = None
    try:
        assert league.stderr is not None
        events = []
        for line in league.stderr:
            events.append(json.loads(line))
            if events[-1]["event"] == "invitation":
                command = shlex.split(events[-1]["command"])[1:]
                command[command.index("FILE")] = str(key)
                player = subprocess.Popen(
                    [*ARENA, *command, "--policy", "patrol", "--data", str(tmp_path / "far")],
                    stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
                )  # fmt: skip
        said = player.communicate(timeout=PATIENCE_S)[0] if player else ""
        document = json.loads(league.stdout.read() if league.stdout else "")
    finally:
        killer.cancel()
        for process in (league, player):
            if process is not None:
                with suppress(ProcessLookupError):
                    process.kill()
                process.communicate()

    assert league.returncode == 0
    assert [event["event"] for event in events] == ["begin", "invitation", *["match"] * 4, "end"]
    assert events[1]["entry"] == "far"
    assert document["matches"]["complete"]
    assert document["league"]["entries"]["far"] == f"key:{public}"
    assert {row["entry"]: row["matches"] for row in document["standings"]} == {"far": 4, "rush": 4}
    assert all(row["forfeits"] == 0 for row in document["standings"]), said
    assert not (data / "keys" / "friday" / "entries" / "far.key").exists()
    assert not (data / "journals" / "friday" / "far.log").exists()


def test_another_key_does_not_get_the_seat_of_a_remote_entry(tmp_path: Path) -> None:
    owner, thief, data = make(tmp_path / "owner.key"), tmp_path / "thief.key", tmp_path / "data"
    make(thief)
    file = tmp_path / "friday.toml"
    file.write_text(f'pairs = 1\nseed = 1\nmaps = "fresh"\n[entries]\nfar = "key:{owner.fingerprint}"\nrush = "rush"\n')
    run = [*ARENA, "tournament", "run", str(file), "--data", str(data), "--progress", "json"]
    league = subprocess.Popen(run, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        assert league.stderr is not None
        command = next(event["command"] for event in map(json.loads, league.stderr) if event["event"] == "invitation")
        arguments = shlex.split(command)[1:]
        arguments[arguments.index("FILE")] = str(thief)
        joined = subprocess.run([*ARENA, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    finally:
        league.terminate()
        league.communicate(timeout=PATIENCE_S)

    assert joined.returncode == 1
    assert "the name far belongs to another key" in joined.stderr


def test_who_listens_everywhere_is_reached_on_loopback(tmp_path: Path) -> None:
    setting = Setting(
        ruleset=load("paper"), entries={"far": "key:x"}, terms=Terms(), slots=2, journals=tmp_path, keys=tmp_path / "keys",
        homes=tmp_path / "homes", remote={"far": bytes(32)}, listen="tcp/0.0.0.0:7447",
    )  # fmt: skip
    address = address_of(setting)

    assert address.endpoint == "tcp/0.0.0.0:7447"
    assert near(address).endpoint == "tcp/127.0.0.1:7447"
    assert near(address).fingerprint == address.fingerprint
    assert str(address) in invitations(setting, address)["far"]
