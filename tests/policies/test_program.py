"""Programs as bots: real processes that read and write JSON lines."""

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from arena.annotations import read_annotations
from arena.errors import PolicyError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import load
from arena.game.types import Team, Termination
from arena.policy import BatchPolicy, MatchResult
from policies import program, registry
from policies.each_seat import UNREADABLE

PAPER = load("paper")
WON = MatchResult(ending=Termination.CAPTURE, winner=Team.RED, score=100, ticks=3)
LISTEN = """
import json, os, sys
log = open(sys.argv[1], "a", buffering=1)
log.write(json.dumps({"pid": os.getpid()}) + "\\n")
for line in sys.stdin:
    log.write(line)
    message = json.loads(line)
    if message["type"] == "observation":
        {answer}
"""
WAIT_S = 60.0
Sit = Callable[[str], BatchPolicy]


@pytest.fixture
def sit(tmp_path: Path) -> Sit:
    """Seat a program that answers each observation as a line of Python says."""

    def begin(answer: str) -> BatchPolicy:
        file = tmp_path / "bot.py"
        file.write_text(LISTEN.replace("{answer}", answer).replace("\\\\n", "\\n"))
        return registry.load(f"exec:{sys.executable} {file} {tmp_path / 'log'}")(PAPER, Team.RED, 1)

    return begin


def ask(policy: BatchPolicy, games: BatchedGame) -> list[int]:
    orders = np.full((1, 6), 9, np.int8)
    policy.act(games.observe()[Team.RED], orders)
    return [int(order) for order in orders[0]]


def heard(folder: Path, n_lines: int = 0) -> list[dict[str, object]]:
    """Return what the program was told, once it has read so many lines."""
    end_s = time.monotonic() + WAIT_S
    while (folder / "log").read_text().count("\n") < n_lines:
        assert time.monotonic() < end_s
        os.sched_yield()
    return [json.loads(line) for line in (folder / "log").read_text().splitlines()]


@pytest.fixture
def games() -> BatchedGame:
    games = BatchedGame(PAPER, 1)
    games.start([0], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])
    return games


def test_a_program_sees_what_a_bot_sees_and_moves_its_units(sit: Sit, games: BatchedGame, tmp_path: Path) -> None:
    policy = sit("print([1, 2, 3, 4, 0, 1], flush=True)")

    assert ask(policy, games) == [1, 2, 3, 4, 0, 1]
    policy.end(0, WON)

    _, start, seen = heard(tmp_path, 3)[:3]
    assert (start["type"], start["team"]) == ("start", "red")
    expected = games.observe()[Team.RED].seat(0, PAPER)
    assert seen["ground"] == expected.ground.tolist()
    assert seen["grid"] == expected.grid.tolist()
    assert [unit["row"] for unit in seen["units"]] == [unit.row for unit in expected.units]  # type: ignore[attr-defined]
    assert (seen["tick"], seen["seed"], seen["clock_s"]) == (0, expected.seed, None)


def test_one_process_plays_match_after_match(sit: Sit, games: BatchedGame, tmp_path: Path) -> None:
    policy = sit("print([0] * 6, flush=True)")
    for _ in range(3):
        policy.start(np.zeros(1, np.intp))
        ask(policy, games)
        policy.end(0, WON)

    said = heard(tmp_path, 10)
    assert [message.get("type", "pid") for message in said] == ["pid", *["start", "observation", "end"] * 3]
    assert said[-1] == {"type": "end", "ending": "capture", "winner": "red", "score": 100, "ticks": 3, "reason": ""}


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        ("sys.exit(3)", "the program ended with exit code 3"),
        ("print('1' * 100_000, flush=True)", "a line has more than 65536 bytes"),
    ],
)
def test_a_program_that_fails_leaves_its_units_and_is_started_anew_for_the_next_match(
    sit: Sit, games: BatchedGame, tmp_path: Path, answer: str, says: str
) -> None:
    policy = sit(answer)

    assert ask(policy, games) == [UNREADABLE] * 6
    assert ask(policy, games) == [UNREADABLE] * 6
    faults = policy.take_faults(0)
    assert faults.raised == 2
    assert says in (faults.first_traceback or "")
    policy.end(0, WON)
    policy.start(np.zeros(1, np.intp))
    ask(policy, games)

    assert len([message for message in heard(tmp_path) if "pid" in message]) == 2


@pytest.mark.parametrize("answer", ["[0, 1]", "None", "{}", "[9] * 6", "'x'", "[[0]] * 6"])
def test_an_answer_that_is_no_action_for_each_unit_is_counted(sit: Sit, games: BatchedGame, answer: str) -> None:
    policy = sit(f"print(json.dumps({answer}), flush=True)")

    assert ask(policy, games) == [UNREADABLE] * 6
    assert policy.take_faults(0).illegal == 1


@pytest.mark.parametrize("is_kept", [True, False])
def test_an_answer_may_hold_a_log_and_drawings_beside_the_orders(is_kept: bool, sit: Sit, games: BatchedGame) -> None:
    drawn = {"cell": [3, 4], "colour": "red", "text": "A"}
    answer = {"orders": [1] * 6, "log": ["tick", "by tick"], "draw": [drawn]}
    policy = sit(f"print(json.dumps({answer}), flush=True)")
    policy.keeps_annotations = is_kept

    assert ask(policy, games) == [1] * 6
    noted = read_annotations(policy.take_annotations(0), PAPER.side)
    assert noted == {"log": ["tick", "by tick"] * is_kept, "draw": [drawn] * is_kept}


def await_end(pid: object) -> None:
    stat, end_s = Path(f"/proc/{pid}/stat"), time.monotonic() + WAIT_S
    while stat.exists() and ") Z " not in stat.read_text():  # a zombie waits for whoever adopts orphans here
        assert time.monotonic() < end_s
        os.sched_yield()


def test_its_children_end_with_it(tmp_path: Path) -> None:
    file = tmp_path / "parent.sh"
    file.write_text("sleep 1000 &\necho $!\nwait\n")
    running = program.Program(["sh", str(file)])
    child = running.receive()

    running.close()

    await_end(child)


def test_it_ends_with_seats_that_are_given_up_in_the_middle_of_a_match(sit: Sit, games: BatchedGame, tmp_path: Path) -> None:
    policy = sit("print([0] * 6, flush=True)")
    ask(policy, games)

    del policy

    await_end(heard(tmp_path, 1)[0]["pid"])


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("/no/such/program", "cannot start /no/such/program: No such file or directory"),
        ("", "the command line is empty"),
        ("'open", "cannot be read"),
        ("node\0", "cannot be started: embedded null byte"),
    ],
)
def test_a_program_that_cannot_be_started_is_said_before_the_match(line: str, says: str) -> None:
    with pytest.raises(PolicyError, match=says):
        registry.load(f"exec:{line}")


def test_lines_that_are_not_json_are_shown_once_and_counted_and_the_program_plays_on(
    sit: Sit, games: BatchedGame, caplog: pytest.LogCaptureFixture
) -> None:
    policy = sit("print('\\x1b[2J' + 'x' * 500, flush=True); print(); print('[0, 1', flush=True); print([1] * 6, flush=True)")

    answers = [ask(policy, games) for _ in range(4)]

    assert answers == [[1] * 6] * 4
    assert policy.take_faults(0).raised == 0
    first, tenth = caplog.messages
    assert first == "bot wrote a line that is not JSON, which is skipped: \\x1b[2J" + "x" * 73 + "..."
    assert tenth == "bot has written 10 lines that are not JSON"


def test_a_program_that_floods_its_stdout_is_ended_with_a_sentence_and_without_a_traceback(
    sit: Sit, games: BatchedGame, caplog: pytest.LogCaptureFixture
) -> None:
    policy = sit("[print('no', number) for number in range(200)]; print([1] * 6, flush=True)")

    assert ask(policy, games) == [UNREADABLE] * 6
    why = "it wrote 100 lines that are not JSON, and no answer; the last was: no 99"
    faults = policy.take_faults(0)
    assert faults.first_traceback == why
    assert list(faults.reasons.values()) == [(f"tick 0: {why}; all its units stay", 1)]
    assert ask(policy, games) == [UNREADABLE] * 6
    assert policy.take_faults(0).first_traceback == "the program ended earlier in this match"


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("print('[1, 1, 1', end='', flush=True); sys.exit(3)", "the program ended with exit code 3"),
        ("print('1' * 70_000, flush=True)", "a line has more than 65536 bytes"),
    ],
)
def test_of_a_line_that_does_not_end_it_is_said_whether_the_program_did(
    answer: str, why: str, sit: Sit, games: BatchedGame
) -> None:
    policy = sit(answer)

    assert ask(policy, games) == [UNREADABLE] * 6
    assert why in (policy.take_faults(0).first_traceback or "")


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("node bots/fast.js", "fast"),
        ("python3 -u 'my bots/slow.py' --depth 3", "slow"),
        ("/usr/bin/java -Xmx1g -jar build/Strong.jar", "Strong"),
        ("./target/release/fast config.json", "fast"),
        ("deno run --allow-read bot.ts", "bot"),
        ("fast", "fast"),
        ("node 'bots/fast.js", "fast"),
        ("", ""),
    ],
)
def test_a_program_is_named_by_its_script_and_not_by_what_runs_it(line: str, name: str) -> None:
    assert program.name_of(line) == name
