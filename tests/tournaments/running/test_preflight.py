"""Who cannot start is named before a league begins: all at once, a sentence each, and nothing is stored."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from family import PATIENCE_S

from arena.errors import InputError
from arena.game.ruleset import load
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox
from tournaments.running import preflight
from tournaments.running.preflight import check_entries
from tournaments.store.store import Store

Arena = Callable[..., subprocess.CompletedProcess[str]]
PAPER = load("paper")
GOOD = "def act(observation):\n    return [0] * len(observation.units)\n"
BAD = {
    "raises": ("import no_such_module\n", "raises.py, line 1: the bot cannot be imported: ModuleNotFoundError"),
    "no_weights": (
        "class Bot:\n    def __init__(self):\n        raise ValueError('no weights')\n    def act(self, seen):\n        pass\n",
        "no_weights cannot start: ValueError: no weights",
    ),
    "no_start": (
        "class Bot:\n    def start(self, info):\n        1 / 0\n    def act(self, seen):\n        return []\n",
        "no_start cannot start: ZeroDivisionError",
    ),
    "leaves": ("import os\nos._exit(0)\n", "leaves cannot start: its process ended with exit code 0"),
}


def write(folder: Path, **bots: str) -> dict[str, str]:
    for name, source in bots.items():
        (folder / f"{name}.py").write_text(source)
    return {name: str(folder / f"{name}.py") for name in bots}


def test_all_failures_are_told_at_once_a_sentence_each(tmp_path: Path) -> None:
    entries = write(tmp_path, good=GOOD, **{name: source for name, (source, _) in BAD.items()})
    programs = {
        "gone": ("exec:/no/such/program", "gone cannot start: cannot start /no/such/program: No such file or directory"),
        "dies": ("exec:false", "the program ended with exit code 1"),
        "listens": ("exec:sh -c 'read line; exit 3'", "the program ended with exit code 3"),
        "fine": ("exec:cat", ""),
    }

    with pytest.raises(InputError) as refused:
        check_entries({"rush": "rush", **entries, **{name: spec for name, (spec, _) in programs.items()}}, PAPER, {})

    lines = str(refused.value).splitlines()
    expected = {name: says for name, (_, says) in [*BAD.items(), *programs.items()] if says}
    assert [line.partition(" cannot start: ")[0] for line in lines] == sorted(expected)
    assert all(expected[line.partition(" ")[0]] in line for line in lines)


def test_a_fighter_is_tried_in_another_process_and_may_answer_nonsense(tmp_path: Path) -> None:
    here = tmp_path / "here"
    source = (
        f"import os, pathlib\npathlib.Path({str(here)!r}).write_text(str(os.getpid()))\nprint('arena')\n"
        "def act(observation):\n    raise ValueError\n"
    )

    check_entries(write(tmp_path, odd=source), PAPER, {})

    assert int(here.read_text()) != os.getpid()


FAILS_IN_SILENCE = """
import os, time
from policies.workers.frames import pack
class Bot:
    def start(self, info):
        for number in range(3, 20):
            try:
                os.write(number, pack([1, b"", [1, 0, "", {}], b""]))
            except OSError:
                continue
        time.sleep(1000)
    def act(self, seen):
        return []
"""


def test_who_fails_without_a_word_is_named_too(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="silent cannot start: it failed, and says nothing of it"):
        check_entries(write(tmp_path, silent=FAILS_IN_SILENCE), PAPER, {})


def test_it_is_told_how_long_who_thinks(tmp_path: Path) -> None:
    slow = "import time\ndef act(observation):\n    time.sleep(0.2)\n    return [0] * len(observation.units)\n"

    think_s = check_entries({**write(tmp_path, slow=slow, good=GOOD), "rush": "rush"}, PAPER, {})

    assert set(think_s) == {"slow", "good"}
    assert think_s["slow"] >= 0.2
    assert think_s["good"] < think_s["slow"]


def test_who_never_answers_can_start_and_is_not_waited_for_for_long(tmp_path: Path) -> None:
    entries = write(tmp_path, loops="def act(observation):\n    while True: pass\n")

    assert set(check_entries(entries, PAPER, {})) == {"loops"}


def test_what_does_not_get_ready_is_not_waited_for_and_ended(tmp_path: Path) -> None:
    entries = write(tmp_path, slow="import time\ntime.sleep(600)\n")

    with pytest.raises(InputError, match=r"slow cannot start: it was not ready after 1 s"):
        check_entries(entries, PAPER, {}, patience_s=1)


INTERRUPTED = """
import signal, sys
from pathlib import Path
from arena.game.ruleset import load
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox
from tournaments.running.preflight import check_entries
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job, and its children, ignore it
check_entries({Path(path).stem: path for path in sys.argv[1:]}, load("paper"), {}, patience_s=1e6)
"""


def test_who_interrupts_it_waits_for_nobody(tmp_path: Path) -> None:
    sleeps = f"import pathlib, time\npathlib.Path({str(tmp_path / 'here')!r}).touch()\ntime.sleep(1e6)\n"
    bots = write(tmp_path, **{f"slow{number}": sleeps for number in range(6)}).values()  # more than are tried at once
    with subprocess.Popen([sys.executable, "-c", INTERRUPTED, *bots], stderr=subprocess.PIPE) as process:
        while not list(tmp_path.rglob("here")):
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.05)
        process.send_signal(signal.SIGINT)
        try:
            process.wait(PATIENCE_S)
        finally:
            process.kill()

    assert process.returncode == -signal.SIGINT


def test_a_fighter_that_its_limits_keep_from_starting_is_named(tmp_path: Path) -> None:
    entries = write(tmp_path, large="weights = bytearray(64 << 30)\n" + GOOD, small=GOOD)
    limited = Sandbox(has_wall=False, limits=NO_LIMITS.with_(["memory_mb=2000"]))

    with pytest.raises(InputError) as refused:
        check_entries({**entries, "rush": "rush"}, PAPER, dict.fromkeys(entries, limited))

    assert str(refused.value).startswith("large cannot start: ")
    assert "MemoryError" in str(refused.value) or "memory" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_our_own_fighters_take_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(preflight, "WorkerFactory", refuse)

    assert check_entries({"rush": "rush", "patrol": "patrol", "far": "key:" + "A" * 43}, PAPER, {}) == {}


def test_nothing_is_stored_of_a_league_with_an_entry_that_cannot_start(here: Arena, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text("import no_such_module\n")
    (tmp_path / "league.toml").write_text('trusted = ["bad"]\nentries = ["rush", "bad.py"]')

    ran = here("tournament", "run", tmp_path / "league.toml", "--venue", "local", "--data", tmp_path / "data")

    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("arena: bad cannot start: ")
    assert ran.stderr.count("\n") == 1
    with Store(str(tmp_path / "data" / "arena.db"), make=False) as store:
        assert store.leagues() == []
    assert [path.name for path in (tmp_path / "data").rglob("*") if path.is_file()] == ["arena.db"]
