"""What an author hears from `arena join` of a bot that is late, and answers nonsense."""

import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arena.records.transcript import load_transcript

Start = Callable[..., Any]
BOT = """
import threading


def act(observation):
    if observation.tick == 1:
        print("too few")
        return [1, 2]
    if observation.tick == 4:
        threading.Event().wait(1.2)
    return [0] * len(observation.units)
"""
LOOP = """
def act(observation):
    while True:
        pass
"""
# A shell that runs these tests in the background has its children ignore interrupts.
ARENA = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from tournaments.cli import main; main()"


def test_join_tells_of_refusals_late_turns_and_the_transcript_and_where_a_bot_is(
    serve: Start, join: Start, tmp_path: Path
) -> None:
    bot, loop, kept = tmp_path / "mybot.py", tmp_path / "loop.py", tmp_path / "kept"
    bot.write_text(BOT)
    loop.write_text(LOOP)
    pit = serve("--matches", 1, "--turn-time", 0.5, "--bank", 0, "--missed", 40, "--grace", 5)
    enemy = join("--team", "red", "--policy", loop, "--no-transcripts", "--no-audit", code=ARENA)
    client = join("--team", "blue", "--policy", bot, "--no-audit", "--transcripts", kept)

    client.wait_for("tick 4 was late")
    enemy.send(signal.SIGINT)

    assert [process.finish() for process in (pit, enemy, client)] == [0, 130, 0]
    (transcript,) = kept.iterdir()
    match = load_transcript(transcript).header.match
    lines = client.said.splitlines()
    begun, ended = lines.index(f"its transcript is written to {transcript}"), lines.index(f"its transcript is {transcript}")
    refused = lines.index(f"match {match}: tick 1: 2 orders for 6 units; all its units stay")
    assert begun < refused < ended
    assert f"match {match}: tick 1: 2 orders for 6 units; all its units stay (1 turn)" in lines[ended:]
    assert f"[{match} blue tick 1] too few" in lines
    late = rf"^match {match}: tick 4 was late: \d+,\d\d\d ms of 500; all its units stayed$"
    assert re.search(late, client.said, re.MULTILINE), client.said
    assert re.search(rf"^match {match}: \d+ turns? late, the worst \d+,\d\d\d ms, at tick \d+$", client.said, re.MULTILINE), (
        client.said
    )
    assert "its transcript" not in enemy.said
    assert re.search(rf"^loop.py is at tick 0 of match {match} as red: line [34] in act: ", enemy.said, re.MULTILINE), enemy.said
