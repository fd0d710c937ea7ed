"""Many who connect and do nothing: whoever plays goes on."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from commands import ARENA, Command

from arena.network.capacity import LEAST_FILES
from arena.protocol.messages import Ended, Orders, Ready, Turn

Start = Callable[..., Command]
N_TICKS = 3
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


def test_a_crowd_that_only_connects_leaves_files_for_the_matches_of_a_pit(
    start: Start, stranger: Callable[..., Any], port: int, tmp_path: Path
) -> None:
    where = ("--listen", f"tcp/127.0.0.1:{port}", "--data", tmp_path)
    pit = start("serve", *where, "--matches", 1, "--set", f"tick_limit={N_TICKS}", code=FEW_FILES).wait_for("join with: ")
    players = [stranger(), stranger()]

    start(port, LEAST_FILES, code=CROWD).wait_for("connected")

    play(players)
    assert pit.finish() == 0, pit.said


def play(players: list[Any]) -> None:
    """Play a match between two who are connected, every unit staying."""
    with ThreadPoolExecutor() as both:
        list(both.map(lambda player: player.sit(name=player.client), players))
    for player in players:
        player.say(Ready(known_ticks=0))
    for tick in range(N_TICKS):
        for player in players:
            assert player.next(Turn).tick == tick
            player.say(Orders(tick=tick, actions=bytes(6)), tick)
    for player in players:
        assert player.next(Ended).ticks == N_TICKS
