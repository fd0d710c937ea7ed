"""An entry that joins by itself, by its key, in a league of the network."""

import json
import os
import shlex
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from arena.game.ruleset import load
from arena.keyring.files import make
from arena.match.time_control import TimeControl
from tournaments.venues.network import address_of, invitations
from tournaments.venues.setting import VenueSetting

ARENA = [sys.executable, "-c", "from tournaments.cli import main; main()"]
PATIENCE_S = 120


@dataclass(frozen=True, kw_only=True)
class Played:
    """A league, at the door of which first a stranger stood, and then the entry that it waits for."""

    public: str
    returncode: int
    events: list[dict[str, Any]]
    document: dict[str, Any]
    stranger: subprocess.CompletedProcess[str]
    said: str
    data: Path


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    folder = tmp_path_factory.mktemp("league")
    key, thief, data, file = folder / "far.key", folder / "thief.key", folder / "data", folder / "friday.toml"
    public = make(key).fingerprint
    make(thief)
    file.write_text(
        f'pairs = 2\nseed = 1\nmaps = "fresh"\n[rules]\ntick_limit = 10\n[entries]\nfar = "key:{public}"\nrush = "rush"\n'
    )
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "ARENA_CONFIG": str(folder / "config")}
    run = [*ARENA, "tournament", "run", str(file), "--data", str(data), "--json"]
    league = subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    killer = threading.Timer(PATIENCE_S, league.kill)
    killer.start()
    player = stranger = None
    try:
        assert league.stderr is not None
        events = []
        for line in league.stderr:
            events.append(json.loads(line))
            if events[-1]["event"] == "invitation":
                theirs, ours = (
                    [str(path) if word == "FILE" else word for word in shlex.split(events[-1]["command"])[1:]]
                    for path in (thief, key)
                )
                stranger = subprocess.run(
                    [*ARENA, *theirs], capture_output=True, text=True, timeout=PATIENCE_S, check=False, env=environment
                )
                player = subprocess.Popen(
                    [*ARENA, *ours, "--policy", "patrol", "--data", str(folder / "far")],
                    stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
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
    assert stranger is not None
    return Played(
        public=public, returncode=league.returncode, events=events, document=document, stranger=stranger, said=said, data=data
    )


def test_a_remote_entry_joins_a_league_at_the_address_that_it_is_told(played: Played) -> None:
    events, document = played.events, played.document

    assert played.returncode == 0
    assert [event["event"] for event in events] == ["begin", "invitation", *["match"] * 4, "end"]
    assert events[1]["entry"] == "far"
    assert document["matches"]["complete"]
    assert document["league"]["entries"]["far"] == f"key:{played.public}"
    assert {row["entry"]: row["matches"] for row in document["standings"]} == {"far": 4, "rush": 4}
    assert all(row["forfeits"] == 0 for row in document["standings"]), played.said
    assert not (played.data / "keys" / "friday" / "entries" / "far.key").exists()
    assert not (played.data / "journals" / "friday" / "far.log").exists()


def test_another_key_does_not_get_the_seat_of_a_remote_entry(played: Played) -> None:
    assert played.stranger.returncode == 1
    assert "the name far belongs to another key" in played.stranger.stderr


def test_who_listens_everywhere_is_reached_on_loopback(tmp_path: Path) -> None:
    setting = VenueSetting(
        ruleset=load("paper"), entries={"far": "key:x"}, time_control=TimeControl(), slots=2, journals=tmp_path,
        keys=tmp_path / "keys",
        homes=tmp_path / "homes", remote={"far": bytes(32)}, listen="tcp/0.0.0.0:7447",
    )  # fmt: skip
    address = address_of(setting)

    assert address.endpoint == "tcp/0.0.0.0:7447"
    assert address.from_here().endpoint == "tcp/127.0.0.1:7447"
    assert address.from_here().fingerprint == address.fingerprint
    assert str(address) in invitations(setting, address)["far"]
