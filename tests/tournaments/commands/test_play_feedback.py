"""What an author hears from `arena play` of a bot that answers nonsense, prints, is slow, or never answers."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., subprocess.CompletedProcess[str]]
# A shell that runs these tests in the background has its children ignore interrupts.
ARENA = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from tournaments.cli import main; main()"
NONSENSE = """
def act(observation):
    print("sees", len(observation.units), end=" ")
    print("units")
    if observation.tick == 1:
        return [1, 2]
    if observation.tick in (2, 3):
        return "north"
    if observation.tick == 4:
        return observation.flags
    return [0] * len(observation.units)
"""
SLOW = """
import threading


def act(observation):
    if observation.tick == 1:
        print("slow")
        threading.Event().wait(0.4)
    while observation.tick == 3:
        pass
    return [0] * len(observation.units)
"""
STUCK = """
import sys


def act(observation):
    if observation.team == 1:
        print("stuck", flush=True)
        {stuck}
    return [0] * len(observation.units)
"""
PROGRAM = """
import json, sys, threading
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "observation":
        if message["team"] == "red":
            print("stuck", file=sys.stderr, flush=True)
            threading.Event().wait()
        print([0] * len(message["units"]), flush=True)
"""


def test_each_kind_of_failure_is_told_once_and_counted(here: Run, tmp_path: Path) -> None:
    (tmp_path / "mybot.py").write_text(NONSENSE)
    arguments = ("play", tmp_path / "mybot.py", "random", "--pairs", 2, "--seed", 1, "--workers", 1, "--set", "tick_limit=6")
    first = "play/mybot/random/0000/mybot-blue/0"

    done = here(*arguments)
    found = json.loads(here(*arguments, "--json").stdout)["faults"]

    told = [line for line in done.stderr.splitlines() if line.startswith("mybot, match ")]
    sentences = [
        "tick 1: 2 orders for 6 units; all its units stay",
        "tick 2: 'north' is no list of orders; all its units stay",
        "tick 4: AttributeError: 'Observation' object has no attribute 'flags' (mybot.py, line 10); all its units stay",
    ]
    assert told == [f"mybot, match {first} as blue: {sentence}" for sentence in sentences]
    assert f"[{first} blue tick 2] sees 6 units\n" in done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith("mybot: ")] == [
        "mybot: 2 orders for 6 units: 4 turns in 4 matches",
        "mybot: 'north' is no list of orders: 8 turns in 4 matches",
        "mybot: AttributeError: 'Observation' object has no attribute 'flags' (mybot.py, line 10): 4 turns in 4 matches",
    ]
    assert done.stderr.count("Traceback") == 1
    assert (found["mybot"]["illegal"], found["mybot"]["raised"], found["random"]["reasons"]) == (12, 4, [])
    assert [(fact["first"], fact["match"], fact["team"]) for fact in found["mybot"]["reasons"]] == [
        (sentence, first, "blue") for sentence in sentences
    ]
    assert [(fact["turns"], fact["matches"]) for fact in found["mybot"]["reasons"]] == [(4, 4), (8, 4), (4, 4)]


def test_on_a_clock_a_bot_is_late_and_forfeits_as_in_a_pit(here: Run, tmp_path: Path) -> None:
    (tmp_path / "mybot.py").write_text(SLOW)
    clock = ("--turn-time", 0.2, "--bank", 0)

    done = here("play", tmp_path / "mybot.py", "random", "--pairs", 1, "--seed", 1, *clock, "--journals", tmp_path / "kept")

    assert done.returncode == 0, done.stderr
    said = done.stderr.splitlines()
    late, forfeited = (
        next(line for line in said if line.startswith("mybot, match ") and what in line) for what in ("allowed", "forfeited")
    )
    assert re.fullmatch(r"mybot, match \S+ as blue: tick \d: \d\.\d\d s, of 0\.2 s allowed; all its units stay", late), late
    assert forfeited.endswith("as blue: forfeited: blue missed 10 turns in a row")
    assert "2 matches (2 by forfeit)" in done.stdout
    [row] = [line.split() for line in done.stdout.splitlines() if line.strip().startswith("mybot ")]
    assert (row[3], int(row[-1]) >= 2 * 9) == ("2", True), row  # the tenth ends the match
    assert re.search(r"\[play/mybot/random/0000/mybot-blue/0 blue tick 1\] slow$", done.stderr, re.MULTILINE)
    assert here("replay", "verify", "--local", tmp_path / "kept").returncode == 0


def test_a_clock_changes_no_match_of_those_who_are_in_time(here: Run, tmp_path: Path) -> None:
    (tmp_path / "east.py").write_text("def act(observation):\n    return [2] * len(observation.units)\n")
    for folder, clock in (("one", ("--turn-time", 60)), ("other", ("--workers", 1))):
        here("play", tmp_path / "east.py", "patrol", "--pairs", 1, "--seed", 1, *clock, "--journals", tmp_path / folder)

    one, other = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("one", "other"))
    assert len(one) == 2
    assert one == other


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["rush", "patrol", "--bank", "3"], "--bank is extra time for turns; give a turn its time by --turn-time"),
        (["rush", "patrol", "--turn-time", "1", "--workers", "2"], "--turn-time plays one match at a time"),
        (["rush", "oracle_rush", "--turn-time", "1"], "oracle_rush is a cheat"),
    ],
)
def test_a_clock_that_cannot_be_run_is_one_sentence(here: Run, options: list[str], says: str) -> None:
    done = here("play", *options)

    assert (done.returncode, done.stdout, done.stderr.count("\n"), says in done.stderr) == (2, "", 1, True), done.stderr


def interrupt(*arguments: object) -> tuple[str, list[str]]:
    """Play until a bot is stuck, interrupt it, and return where it stood and where bots were."""
    command = [sys.executable, "-c", ARENA, "play", *map(str, arguments)]
    playing = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert playing.stderr is not None
    before = []
    for line in playing.stderr:
        before.append(line)
        if "stuck\n" in line:
            break
    playing.send_signal(signal.SIGINT)
    out, err = playing.communicate(timeout=60)
    assert (playing.returncode, out) == (130, ""), "".join(before) + err
    stopped, *where = [line for line in err.splitlines() if "stuck\n" not in line and not line.startswith("[")]
    return stopped, where


@pytest.mark.parametrize(
    ("stuck", "how", "ended"),
    [
        ("while True: pass", ("--workers", 1), 1),
        ("sum(iter(int, 1))", ("--workers", 2), None),
        ("sum(iter(int, 1))", ("--turn-time", 60), 1),
    ],
    ids=["in this process", "in a worker, in compiled code", "on a clock, in compiled code"],
)
def test_an_interrupt_says_where_a_stuck_bot_is_and_keeps_what_was_played(
    tmp_path: Path, here: Run, stuck: str, how: tuple[object, ...], ended: int | None
) -> None:
    (tmp_path / "mybot.py").write_text(STUCK.format(stuck=stuck))
    quick = ("--pairs", 1, "--seed", 1, "--set", "tick_limit=2", "--journals", tmp_path / "kept")

    stopped, where = interrupt(tmp_path / "mybot.py", "random", *quick, *how)

    if ended is None:  # where two workers play, the other match may have ended or not
        where = [line for line in where if "/random-blue/" in line]
    [place] = where  # it may have been about to print a moment ago
    prefix, _, line = place.partition(": ")
    assert prefix == "mybot.py is at tick 0 of match play/mybot/random/0000/random-blue/0 as red"
    assert line in (f"line 8 in act: {stuck}", 'line 7 in act: print("stuck", flush=True)')
    if ended is not None:
        assert stopped.startswith(f"stopped after {ended} of 2 matches: mybot won ")
        assert [path.name for path in (tmp_path / "kept").iterdir()] == ["play+mybot+random+0000+mybot-blue+0.journal"]
        assert here("replay", "verify", "--local", tmp_path / "kept").returncode == 0


def test_an_interrupt_says_which_tick_a_program_has_not_answered(tmp_path: Path) -> None:
    (tmp_path / "bot.py").write_text(PROGRAM)

    _, where = interrupt(
        f"exec:{sys.executable} {tmp_path / 'bot.py'}", "random", "--pairs", 1, "--workers", 1, "--set", "tick_limit=2"
    )

    assert where == ["a bot was asked at tick 0 of match play/bot/random/0000/random-blue/0 as red, and has not answered"]
