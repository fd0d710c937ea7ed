"""The README and the pages of docs can be followed: each is read from top to bottom, and what it says is done."""

import json
import re
import subprocess
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pages import FILES, PAGES, Step, steps, words

Run = Callable[..., subprocess.CompletedProcess[str]]
NOT_RUN = {
    r"arena (serve|join|watch|web|admin|doctor --pit)": "waits for others on the network: tests/e2e/ runs them",
    r"arena train (?!figures)": "takes minutes: the notebook trains in small, tests/policies/training/ in every way",
    r"arena train figures": "draws the runs that took hours: tests/policies/training/test_figures.py draws small ones",
    r"arena evaluate champion": "takes minutes: tests/policies/training/ evaluates",
    r"arena tournament (run|report) (fighters|starter)": "takes minutes: tests/tournaments/running/ runs leagues",
    r"arena tournament .*(--venue ray|--ratings NAME)": "needs a cluster, or a plug-in: tests/tournaments/venues/ has them",
    r"arena bench": "measures for minutes: tests/benchmarks/",
    r"arena doctor --compile": "takes a minute: make setup runs it",
    r"arena play .*--sandbox": "needs bubblewrap: tests/arena/sandbox/",
    r"arena replay (show|verify) (TRANSCRIPT|JOURNAL|DATA)": "of a match in a pit: tests/e2e/test_transcripts.py",
}
"""Command lines of the arena that no page's test runs, and why; test_readme.py has the real parser read each."""
OTHERS = ("pip install", "make ", "docker ", "for seed in", "torchrun ", "apt ", "ray ", "cd ", ". ")
"""How the lines of other programs begin that a reader types; they install, or take hours."""
NAMES = {name for name, page in PAGES.items() if any(step.code or step.line for step in steps(page))}
BOTS = {name: code for name, code in FILES.items() if name.endswith(".py") and "def act(" in code}


def reason_not_to_run(line: str) -> str | None:
    return next((why for pattern, why in NOT_RUN.items() if re.match(pattern, line)), None)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give a page a folder of its own to work in, and its own place for data."""
    home = tmp_path / "home"
    work = tmp_path / "work"
    home.mkdir()
    work.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("XDG_DATA_HOME", str(home))
    monkeypatch.chdir(work)
    yield work


def do(step: Step, here: Run) -> None:
    """Do what one step says."""
    if step.needs:
        Path(step.needs).write_text(FILES[step.needs])
    elif step.file and step.code:
        Path(step.file).write_text(step.code)
    elif step.language == "python":
        exec(step.code or "", {})
    elif step.language == "toml":
        tomllib.loads(step.code or "")
    elif step.language == "json":
        json.loads(step.code or "")
    elif step.line and step.line.startswith("arena ") and reason_not_to_run(step.line) is None:
        done = here(*words(step.line))
        assert done.returncode == 0, f"{step.line}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_page_can_be_followed(name: str, here: Run, folder: Path, one_core: None) -> None:
    for step in steps(PAGES[name]):
        do(step, here)


@pytest.mark.parametrize("name", sorted(BOTS))
def test_a_bot_of_a_page_plays_without_a_fault(name: str, here: Run, folder: Path, one_core: None) -> None:
    Path(name).write_text(BOTS[name])

    done = here("play", name, "random", "--pairs", 5, "--seed", 1, "--json")

    report = json.loads(done.stdout)
    [faults] = (found for entry, found in report["faults"].items() if entry != "random")
    assert faults["raised"] == faults["illegal"] == 0
    assert report["score"] > 0.3


def test_every_line_that_is_not_run_is_still_there() -> None:
    lines = [step.line for page in PAGES.values() for step in steps(page) if step.line]

    assert [pattern for pattern in NOT_RUN if not any(re.match(pattern, line) for line in lines)] == []
