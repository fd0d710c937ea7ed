"""The fixtures that pytest finds once the arena is installed."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLUGIN = "tournaments.pytest_plugin"
AUTHORS_TEST = """
def act(observation):
    return [2 for _ in observation.units]

BOARD = '''
    FU.f
    ....
    ....
    ...u
'''

def test_it_captures(drawn_match):
    assert drawn_match(BOARD).play(blue=act).describe().startswith("blue wins by capture after 2 ticks")

def test_it_goes_east(observation_from_board):
    assert act(observation_from_board(BOARD, tick=3)) == [2]

def test_it_is_quick(assert_never_slower_than):
    assert_never_slower_than(act, 1000, matches=1)

def test_it_loses(play_pairs):
    score = play_pairs(act, "rush", pairs=2)
    assert score.n_faults == 0, str(score)
    assert score.score < 0.5, str(score)

def test_it_wins(play_pairs):
    score = play_pairs(act, "rush", pairs=2)
    assert score.score > 0.9, str(score)
"""


def test_an_author_s_tests_find_the_kit_and_say_what_came_of_it(compiled: None, tmp_path: Path) -> None:
    (tmp_path / "test_mybot.py").write_text(AUTHORS_TEST)
    command = [sys.executable, "-m", "pytest", "-q", "-p", PLUGIN, "-p", "no:cacheprovider", "test_mybot.py"]
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # by its name here, wherever the package is installed
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False)

    assert "1 failed, 4 passed" in done.stdout, done.stdout + done.stderr
    assert "AssertionError: 0 wins, 0 draws, 4 losses, 0 failed turns: score 0.000 (0.000 to 0.776)" in done.stdout


def test_it_is_the_plug_in_that_the_package_names() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

    assert project["entry-points"]["pytest11"] == {"arena": PLUGIN}


def test_pytest_starts_without_importing_anything_for_it() -> None:
    code = f"import sys, pytest; before = set(sys.modules); import {PLUGIN}; print(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout.split() == ["tournaments", PLUGIN]
