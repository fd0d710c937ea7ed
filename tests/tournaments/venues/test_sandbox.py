"""Fighters under limits: real processes."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from family import wait_for_the_end_of

from arena.errors import InputError
from tournaments.league.file import parse_league
from tournaments.league.limits import Limits
from tournaments.venues.sandbox import SandboxedProcess

WAIT_S = 60.0


def run(code: str, folder: Path, limits: Limits) -> tuple[int, str]:
    """Run Python under limits, and return its exit code and what it said."""
    with (folder / "log").open("wb") as log:
        sandboxed = SandboxedProcess([sys.executable, "-c", code], limits, folder / "home", log)
        try:
            return sandboxed.process.wait(WAIT_S), (folder / "log").read_text()
        finally:
            sandboxed.end(0)


def test_it_lives_in_a_home_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARENA_CONFIG", "/elsewhere")
    monkeypatch.setenv("XDG_CONFIG_HOME", "/elsewhere")
    code = (
        "import os; print(os.getcwd(), os.path.expanduser('~'), "
        "[name for name in os.environ if name in ('ARENA_CONFIG', 'XDG_CONFIG_HOME')])"
    )

    assert run(code, tmp_path, Limits()) == (0, f"{tmp_path / 'home'} {tmp_path / 'home'} []\n")
    assert (tmp_path / "home").stat().st_mode & 0o777 == 0o700


def test_it_gets_no_more_memory_than_it_may_have(tmp_path: Path) -> None:
    code = "try:\n    bytearray(2 << 30)\nexcept MemoryError:\n    print('no')\nelse:\n    print('yes')"

    assert run(code, tmp_path, Limits(memory_mb=1_000)) == (0, "no\n")
    assert run(code, tmp_path, Limits()) == (0, "yes\n")


def test_it_gets_no_more_time_than_it_may_have(tmp_path: Path) -> None:
    code, _ = run("while True: pass", tmp_path, Limits(cpu_s=1))

    assert code < 0, "the kernel ended it"


def test_what_it_started_ends_with_it(tmp_path: Path) -> None:
    code = (
        "import subprocess, sys, time\n"
        "print(subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(1000)']).pid, flush=True)\n"
        "time.sleep(1000)"
    )
    with (tmp_path / "log").open("wb") as log:
        sandboxed = SandboxedProcess([sys.executable, "-c", code], Limits(), tmp_path / "home", log)
        end_s = time.monotonic() + WAIT_S
        while not (child := (tmp_path / "log").read_text().strip()):
            assert time.monotonic() < end_s
            os.sched_yield()

        sandboxed.end(0)

    stat = Path(f"/proc/{child}/stat")
    while stat.exists() and " Z " not in stat.read_text():  # a zombie waits for whoever adopts orphans here
        assert time.monotonic() < end_s
        os.sched_yield()


HOLDER = """
import sys
from pathlib import Path
from tournaments.league.limits import Limits
from tournaments.venues.sandbox import SandboxedProcess
folder = Path(sys.argv[1])
with (folder / "log").open("wb") as log:
    sandboxed = SandboxedProcess([sys.executable, "-c", sys.argv[2]], Limits(), folder / "home", log)
print(sandboxed.process.pid, flush=True)
input()
"""


def test_it_ends_with_its_children_when_whoever_started_it_is_killed(tmp_path: Path) -> None:
    sleep = "import time; time.sleep(1000)"
    code = f"import subprocess, sys; print(subprocess.Popen([sys.executable, '-c', {sleep!r}]).pid, flush=True); {sleep}"
    command = [sys.executable, "-c", HOLDER, str(tmp_path), code]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        pid = int(holder.stdout.readline())
        end_s = time.monotonic() + WAIT_S
        while not (child := (tmp_path / "log").read_text().strip()):
            assert time.monotonic() < end_s
            os.sched_yield()

        holder.kill()

        wait_for_the_end_of([pid, int(child)])


def test_it_has_nothing_to_read_and_no_child_that_it_did_not_start(tmp_path: Path) -> None:
    code = "import os, sys\nprint(repr(sys.stdin.read()))\ntry:\n    os.wait()\nexcept ChildProcessError:\n    print('no child')"

    assert run(code, tmp_path, Limits()) == (0, "''\nno child\n")


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ("memory_mb = 0", "it must be a whole number above 0"),
        ('cpu_s = "much"', "it must be a whole number above 0"),
        ("memry_mb = 1", "did you mean 'memory_mb'"),
    ],
)
def test_limits_that_are_none_are_said_in_one_sentence(limits: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        parse_league(f'entries = ["rush", "patrol"]\n[limits]\n{limits}', "g", Path())

    assert says in str(error.value)


def test_a_league_says_its_limits() -> None:
    league = parse_league('entries = ["rush", "patrol"]\n[limits]\nmemory_mb = 5_000', "g", Path())

    assert league.limits == Limits(memory_mb=5_000)
