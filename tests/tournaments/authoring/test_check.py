"""What a check finds of a bot: each fault in a sentence, with its tick, and whether a league would take the bot."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.errors import InputError, PolicyError
from arena.game.ruleset import load
from arena.match.time_control import TimeControl
from tournaments.authoring.check import check, find_bot
from tournaments.authoring.findings import Report
from tournaments.authoring.global_randomness import find_global_randomness

Arena = Callable[..., subprocess.CompletedProcess[str]]
Examine = Callable[..., Report]
PATIENT = TimeControl(turn_time_s=60.0)
"""Where a busy machine is not to be told of."""
SMALL = load("paper").with_({"side": 10, "tick_limit": 12})
GOOD = "def act(observation):\n    return [1 + (observation.tick + unit.index) % 4 for unit in observation.units]\n"
SEVERAL_FAULTS = """
import random

KEPT = []


def act(observation):
    if observation.tick == 2:
        print("hello \\x1b[2J")
    if observation.tick == 3:
        return [0]
    if observation.tick == 4:
        return divide(observation.tick)
    KEPT.append(bytearray(300_000))
    return [random.randrange(5) for unit in observation.units]


def divide(tick):
    return tick / 0
"""


@pytest.fixture
def examine(tmp_path: Path) -> Examine:
    def run(source: str, **settings: object) -> Report:
        file = tmp_path / "bot.py"
        file.write_text(source)
        return check(str(file), SMALL, opponents=["random"], **settings)  # type: ignore[arg-type]

    return run


def sentences(report: Report) -> dict[str, str]:
    return {finding.kind: finding.sentence for finding in report.findings}


def test_a_good_bot_is_accepted_and_its_figures_are_told(examine: Examine) -> None:
    n_played: list[int] = []

    report = examine(GOOD, advance=n_played.append, time_control=PATIENT)

    assert (report.is_accepted, report.findings, sum(n_played)) == (True, (), 4)
    assert report.wins + report.draws + report.losses == len(report.matches) == 2
    assert report.times is not None
    assert report.times.median_ms <= report.times.p99_ms <= report.times.worst_ms
    assert report.size_bytes == len(GOOD)
    assert report.describe()[-1] == "a league would take it"


def test_extra_time_without_end_is_a_clock_like_others(examine: Examine) -> None:
    report = examine(GOOD, time_control=TimeControl(turn_time_s=60.0, bank_s=math.inf))

    assert (report.is_accepted, report.findings) == (True, ())


def test_a_fighter_that_ships_has_no_size() -> None:
    report = check("random", SMALL, opponents=["random"], time_control=PATIENT)

    assert report.size_bytes is None
    assert report.describe()[0] == f"random: ready after {report.load_s:.2f} s"


def test_each_fault_is_told_with_its_tick_and_line_and_a_league_takes_the_bot_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "bot.py").write_text(SEVERAL_FAULTS)

    report = check(str(tmp_path / "bot.py"), SMALL, opponents=["random", "random"])

    told = [finding.sentence for finding in report.findings]
    assert report.is_accepted
    assert any(one.startswith("tick 3 of match 1, blue against random: 1 orders for 6 units") for one in told)
    exception = next(one for one in told if "ZeroDivisionError" in one)
    assert exception.startswith("tick 4 of match 1, blue against random: ")
    assert "bot.py, line 19" in exception
    assert any("other orders the second time, from the same keys" in one for one in told)
    assert any("random.randrange (line 15)" in one for one in told)
    assert sentences(report)["output"] == "it prints, the first time: [1 blue tick 2] hello \\x1b[2J"
    if sys.platform.startswith("linux"):  # elsewhere, nobody tells of another process's memory
        assert report.growth_bytes is not None
        assert report.growth_bytes > 2_000_000
        assert "grows by" in sentences(report)["memory"]


def test_a_bot_that_remembers_earlier_matches_plays_otherwise_without_them(examine: Examine) -> None:
    counts = "N = [0]\ndef act(observation):\n    N[0] += 1\n    return [N[0] // 12 % 5 for unit in observation.units]\n"

    assert "when no other match came before it" in sentences(examine(counts))["chance"]


def test_an_endless_loop_is_found_and_the_check_ends(examine: Examine) -> None:
    loops = "def act(observation):\n    while observation.tick == 3:\n        pass\n    return [0] * len(observation.units)\n"

    report = examine(loops, time_control=TimeControl(turn_time_s=1.5, bank_s=0.5))

    assert not report.is_accepted
    told = sentences(report)["process"]
    assert told.startswith(
        "tick 3 of match 1, blue against random: no answer within 1.5 s or the 0.5 s of extra time; it stood at"
    )
    assert "line 3 in act" in told or "line 2 in act" in told


def test_a_bot_that_is_always_too_slow_would_be_forfeited(examine: Examine) -> None:
    slow = "import time\ndef act(observation):\n    time.sleep(0.02)\n    return [0] * len(observation.units)\n"

    spends_its_bank = examine(slow, time_control=TimeControl(turn_time_s=0.01, bank_s=5.0), most_s=1.0)

    assert not spends_its_bank.is_accepted
    assert "in the median, and 0.01 s are given" in sentences(spends_its_bank)["slow"]


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("import no_such_module\n", "bot.py, line 1: the bot cannot be imported: ModuleNotFoundError"),
        ("def act(observation)\n    return []\n", "bot.py, line 1: this is not Python"),
        (
            "class Bot:\n    def start(self, info):\n        1 / 0\n    def act(self, seen):\n        return []\n",
            "bot.py, line 3",
        ),
        ("import os\ndef act(seen):\n    os._exit(3)\n", "its process ended with exit code 3"),
        ("def act(seen):\n    return seen.nothing\n", "it gave orders in none of its"),
    ],
)
def test_what_a_league_would_refuse_is_told_in_a_sentence(examine: Examine, source: str, says: str) -> None:
    report = examine(source)

    assert not report.is_accepted
    assert says in " ".join(finding.sentence for finding in report.findings if finding.is_fatal)


def test_a_bot_that_misses_a_file_hears_what_there_is_behind_its_wall(examine: Examine, tmp_path: Path) -> None:
    (tmp_path / "weights.txt").write_text("1 2 3")
    report = examine(f"open({str(tmp_path / 'weights.txt')!r})\n")

    if report.no_wall is not None and not os.environ.get("ARENA_REQUIRE_ALL"):
        pytest.skip(report.no_wall)
    assert sentences(report)["load"].endswith("; behind its wall a bot sees its own file and what is installed with the arena")


def test_a_program_is_checked_and_its_lines_that_are_no_json_are_told(tmp_path: Path) -> None:
    script = tmp_path / "fast.py"
    script.write_text(
        "while line := input():\n    if 'observation' in line:\n        print('debug', flush=True)\n        print([0] * 6)\n"
    )

    report = check(f"exec:python3 -u {script}", SMALL, opponents=["random"])

    assert report.is_accepted
    assert report.size_bytes >= script.stat().st_size
    assert any("fast wrote a line that is not JSON, which is skipped: debug" in finding.sentence for finding in report.findings)


def test_a_bot_is_found_in_its_folder_and_what_is_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mybot").mkdir()
    with pytest.raises(InputError, match=r"a folder without a bot\.py"):
        find_bot(str(tmp_path / "mybot"))
    (tmp_path / "mybot" / "bot.py").touch()

    assert find_bot(str(tmp_path / "mybot")) == str(tmp_path / "mybot" / "bot.py")
    with pytest.raises(InputError, match="there is no bot file"):
        find_bot("gone.py")
    with pytest.raises(InputError, match="did you mean 'rush'"):
        find_bot("rsh")
    with pytest.raises(InputError, match="there is no bot file xxx"):
        find_bot("x" * 300 + ".py")


def test_a_file_without_a_bot_is_bad_input(examine: Examine) -> None:
    with pytest.raises(PolicyError, match="has no bot; write a function act"):
        examine("x = 1\n")


def test_the_command_says_it_in_lines_or_as_json_and_by_its_exit_code(here: Arena, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text("import no_such_module\n")
    (tmp_path / "none.py").write_text("x = 1\n")

    refused = here("check", tmp_path / "bad.py", "--json")
    none = here("check", tmp_path / "none.py")

    assert refused.returncode == 1
    assert json.loads(refused.stdout)["ok"] is False
    assert json.loads(refused.stdout)["findings"][0]["is_fatal"] is True
    assert (none.returncode, none.stdout, none.stderr.count("\n")) == (2, "", 1)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import random\nrandom.random()", [(2, "random.random")]),
        ("from random import choice as pick\npick([1])", [(2, "random.choice")]),
        (
            "import numpy as np\nnp.random.rand(3)\nnp.random.default_rng()",
            [(2, "numpy.random.rand"), (3, "numpy.random.default_rng")],
        ),
        ("import numpy as np\nnp.random.default_rng(7).random()\nnp.random.Generator(np.random.PCG64(3))", []),
        ("import random\nrandom.Random(3).random()", []),
        ("import os\nos.urandom(3)", [(2, "os.urandom")]),
        ("def act(o):\n    return o.rng.integers(5, size=6)", []),
        ("random = 3\nrandom.x()", []),
        ("def act(", []),
        pytest.param("-" * 100_000 + "1", [], id="deep"),
        pytest.param("1+" * 100_000 + "1", [], id="long"),
        pytest.param("import random\nrandom" + ".a" * 1_500 + "()", [], id="names"),
    ],
)
def test_calls_of_global_randomness_are_found_in_the_source(source: str, found: list[tuple[int, str]]) -> None:
    assert find_global_randomness(source) == found
