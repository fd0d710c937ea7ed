"""The README and the pages of docs can be followed: each is read from top to bottom, and what it says is done."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import playwright
import pytest
from pages import FILES, PAGES, ROOT, Step, steps, words

from tournaments.league.file import load_league

Run = Callable[..., subprocess.CompletedProcess[str]]
NOT_RUN = {
    r"arena (serve|join|watch|relay|web|leaderboard --ladder)": "waits for others on the network: tests/e2e/ runs them",
    r"arena (season|backup course|restore course)": "is a season's: tests/tournaments/test_course.py follows its page",
    r"arena (backup|restore) all": "is of a folder that plays: tests/tournaments/test_backup.py",
    r"arena train (?!figures)": "takes minutes: the notebook trains in small, tests/policies/training/ in every way",
    r"arena train figures": "draws the runs of hours: tests/policies/training/test_figures.py draws small ones",
    r"arena check": "starts processes behind walls for half a minute: tests/tournaments/authoring/",
    r"arena submit": "waits for the check of a season: tests/tournaments/season/test_submit.py",
    r"arena debug .*--tick": "waits for somebody at a debugger: tests/e2e/test_debugging_at_a_terminal.py",
    r"arena play .*--step": "waits for somebody at a terminal: tests/e2e/test_stepping_at_a_terminal.py",
    r"arena play .*--sandbox": "needs bubblewrap: tests/arena/sandbox/",
    r"arena play mybot.py old/mybot.py": "the reader keeps their old version: tests/tournaments/authoring/test_until_sure.py",
    r"arena gauntlet": "plays 600 matches: tests/tournaments/authoring/test_gauntlet.py plays few",
    r"arena tournament run LEAGUE.toml --venue ray": "needs a cluster: tests/tournaments/venues/",
    r"arena (play|evaluate) runs/": "plays what was trained in minutes: the notebook does so in small",
    r"arena replay (show|verify) (TRANSCRIPT|JOURNAL|DATA)": "is of a match in a pit: tests/e2e/test_transcripts.py",
}
"""Command lines of the arena that no page's test runs, and why; test_readme.py has the real parser read each."""
FASTER = {
    r"arena tournament run friday.toml(?! --)": "--venue local",  # not the half minute of processes with clocks
    r"arena play .* --until-sure": "--pairs 5",
}
"""What is added to a command line, so that it takes a second."""
NAMES = {name for name, page in PAGES.items() if any(step.code or step.line for step in steps(page))}
BOTS = {name: code for name, code in FILES.items() if name.endswith(".py") and "def act(" in code}


def reason_not_to_run(line: str) -> str | None:
    return next((why for pattern, why in NOT_RUN.items() if re.match(pattern, line)), None)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a page a folder of its own to work in, and its own place for data."""
    home = tmp_path / "home"
    work = tmp_path / "work"
    home.mkdir()
    work.mkdir()
    monkeypatch.setenv("XDG_DATA_HOME", str(home))
    if shutil.which("node") is None:  # playwright brings one
        (tmp_path / "node").symlink_to(Path(playwright.__file__).parent / "driver" / "node")
        monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.chdir(work)
    return work


def do(step: Step, here: Run) -> None:
    """Do what one step says."""
    if step.needs:
        Path(step.needs).write_text(FILES[step.needs])
    elif step.file and step.code:
        Path(step.file).write_text(step.code)
        if step.file.endswith(".toml"):
            load_league(step.file)
    elif step.language == "python":
        exec(step.code or "", {})
    elif step.language == "toml":
        tomllib.loads(step.code or "")
    elif step.language == "json":
        json.loads(step.code or "")
    elif step.line and step.line.startswith("pytest "):
        command = [sys.executable, "-m", *step.line.split()]
        tested = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert tested.returncode == 0, tested.stdout + tested.stderr
    elif step.line and step.line.startswith("arena ") and reason_not_to_run(step.line) is None:
        added = [word for pattern, more in FASTER.items() if re.match(pattern, step.line) for word in more.split()]
        done = here(*words(step.line), *added)
        assert done.returncode == 0, f"{step.line}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_page_can_be_followed(name: str, here: Run, folder: Path, one_core: None) -> None:
    for step in steps(PAGES[name]):
        do(step, here)


@pytest.mark.parametrize("name", sorted(BOTS))
def test_a_bot_of_a_page_plays_without_a_fault(name: str, here: Run, folder: Path, one_core: None) -> None:
    for file, code in BOTS.items():
        Path(file).write_text(code)

    done = here("play", name, "random", "--pairs", 5, "--seed", 1, "--json")

    report = json.loads(done.stdout)
    [faults] = (found for entry, found in report["faults"].items() if entry != "random")
    assert faults["raised"] == faults["illegal"] == 0
    assert report["score"] > 0.3


def test_every_line_that_is_not_run_is_still_there() -> None:
    lines = [step.line for page in PAGES.values() for step in steps(page) if step.line]

    assert [pattern for pattern in NOT_RUN if not any(re.match(pattern, line) for line in lines)] == []


def test_an_extra_that_is_installed_exists() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = [
        name for page in PAGES.values() for found in re.findall(r"arena-pit\[([a-z0-9,]+)\]", page) for name in found.split(",")
    ]

    assert named
    assert set(named) <= extras.keys()


def test_a_file_that_two_pages_save_is_the_same() -> None:
    saved = {(step.file, step.code) for page in PAGES.values() for step in steps(page) if step.file}

    assert len(saved) == len(FILES)
