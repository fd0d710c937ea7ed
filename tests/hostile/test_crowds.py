"""Many who connect and do nothing: whoever plays goes on."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from commands import ARENA, Command

from arena.network.capacity import LEAST_FILES

Start = Callable[..., Command]
N_TICKS = 3
PATIENCE_S = 60.0
FEW_FILES = f"import resource; resource.setrlimit(resource.RLIMIT_NOFILE, ({LEAST_FILES}, {LEAST_FILES})); {ARENA}"
CROWD = """
import json, sys, threading, zenoh
sessions = []
for number in range(int(sys.argv[2])):
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"), ("connect/endpoints", ["tcp/127.0.0.1:" + sys.argv[1]]), ("scouting/multicast/enabled", False),
        ("connect/timeout_ms", 500), ("connect/exit_on_failure", True),
    ):
        config.insert_json5(key, json.dumps(value))
    try:
        sessions.append(zenoh.open(config))
    except zenoh.ZError:
        break
print("connected", len(sessions), flush=True)
threading.Event().wait()
"""
"""Sessions that do nothing, as many as are taken."""


def test_a_crowd_that_does_nothing_keeps_nobody_out_and_leaves_files_for_matches(
    start: Start, play_here: Callable[..., Any], port: int, tmp_path: Path
) -> None:
    where = ("--listen", f"tcp/127.0.0.1:{port}", "--data", tmp_path)
    pit = start("serve", *where, "--matches", 1, "--set", f"tick_limit={N_TICKS}", code=FEW_FILES).wait_for("join with: ")
    start(port, LEAST_FILES, code=CROWD).wait_for("connected")

    players = [play_here("random", name=name) for name in ("ann", "bob")]

    assert [player.result(PATIENCE_S) for player in players] == [1, 1]
    assert pit.finish() == 0, pit.said
