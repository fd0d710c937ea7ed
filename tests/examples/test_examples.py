"""The examples train, and what they trained stands in a league's table: each is run at a size of seconds."""

import csv
import json
import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from tournaments.league.file import load_league

EXAMPLES = Path(__file__).parents[2] / "examples"
Run = Callable[..., subprocess.CompletedProcess[str]]
SMALLER = {
    "sb3_ppo": ("make_sb3(32,", "make_sb3(8,"),
    "cleanrl_ppo": ("NUM_MINIBATCHES = 64, 64, 3, 8", "NUM_MINIBATCHES = 4, 8, 1, 2"),
    "selfplay_pettingzoo": (
        "N_MATCHES, N_TICKS, RATE, GAMMA, ENTROPY = 16, 32,",
        "N_MATCHES, N_TICKS, RATE, GAMMA, ENTROPY = 2, 4,",
    ),
}
"""What makes one update of each a matter of a moment."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the examples to train and play in."""
    if find_spec("stable_baselines3") is None:
        lack = pytest.fail if os.environ.get("ARENA_REQUIRE_ALL") == "1" else pytest.skip
        lack("stable_baselines3 is not installed")
    copy = tmp_path / "examples"
    shutil.copytree(EXAMPLES, copy, ignore=shutil.ignore_patterns("*.zip", "*.pt", "__pycache__"))
    monkeypatch.chdir(copy)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return copy


def test_every_example_is_run_here() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(SMALLER)


def test_stable_baselines_takes_forty_lines() -> None:
    lines = (EXAMPLES / "sb3_ppo.py").read_text().splitlines()
    code = [line for line in lines[lines.index('"""', 1) + 1 :] if line.strip() and not line.startswith(("import", "from"))]

    assert len(code) <= 40


@pytest.fixture
def train(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Train an example in its smallest size."""

    def run(name: str) -> None:
        before, after = SMALLER[name]
        text = (folder / f"{name}.py").read_text()
        assert before in text
        (folder / f"{name}.py").write_text(text.replace(before, after))
        monkeypatch.setattr(sys, "argv", [f"{name}.py", "1"])
        runpy.run_path(str(folder / f"{name}.py"), run_name="__main__")

    return run


def test_what_stable_baselines_trained_stands_in_a_league_s_table(
    folder: Path, train: Callable[[str], None], here: Run, one_core: None
) -> None:
    train("sb3_ppo")
    league = (folder / "league.toml").read_text().replace("pairs = 10", "pairs = 1\nseed = 1")
    (folder / "league.toml").write_text(league + "[rules]\ntick_limit = 20\n")

    done = here("tournament", "run", "league.toml", "--data", "data", "--format", "csv")

    assert done.returncode == 0, done.stderr
    assert {row["entry"] for row in csv.DictReader(done.stdout.splitlines())} == {"sb3", "patrol", "random"}


@pytest.mark.parametrize("name", ["cleanrl_ppo", "selfplay_pettingzoo"])
def test_what_the_others_trained_plays_without_a_fault(
    name: str, train: Callable[[str], None], here: Run, one_core: None
) -> None:
    train(name)

    done = here("play", f"{name}.py", "random", "--pairs", 1, "--seed", 1, "--json")

    assert done.returncode == 0, done.stderr
    [faults] = (found for entry, found in json.loads(done.stdout)["faults"].items() if entry != "random")
    assert faults["raised"] == faults["illegal"] == 0


def test_the_league_s_file_takes_all_three(folder: Path) -> None:
    text = (folder / "league.toml").read_text().replace("# cleanrl =", "cleanrl =").replace("# selfplay =", "selfplay =")
    (folder / "league.toml").write_text(text.replace('["sb3"]', '["sb3", "cleanrl", "selfplay"]'))

    entries = load_league(str(folder / "league.toml")).entries
    assert set(entries) == {"sb3", "cleanrl", "selfplay", "patrol", "random"}
