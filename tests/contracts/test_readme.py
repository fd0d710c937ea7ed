"""The README and its docs keep their word."""

import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from arena.game.observation import Observation, Observations, OwnUnit
from arena.game.ruleset import load
from arena.game.types import Action, Code, Team
from tournaments.cli import COMMANDS

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def see(*, flag: tuple[int, int] | None) -> Observation:
    """Return what blue sees with units at (2, 1) and (0, 1)."""
    ground = np.zeros((4, 4), np.int8)
    if flag is not None:
        ground[flag] = Code.RED_FLAG
    places = [(2, 1), (0, 1)]
    units = tuple(
        OwnUnit(index=index, type="ugv", row=row, column=column, alive=True, flies=False)
        for index, (row, column) in enumerate(places)
    )
    ruleset = load("paper")
    return replace(Observations.blank(ruleset, Team.BLUE, 1).seat(0, ruleset), ground=ground, units=units)


def test_its_bot_walks_to_the_flag_that_it_sees_and_wanders_otherwise() -> None:
    [code] = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    names: dict[str, object] = {}
    exec(code, names)
    act = names["act"]
    assert callable(act)

    assert act(see(flag=(0, 3))) == [Action.NORTH, Action.EAST]
    assert all(0 <= action <= 4 for action in act(see(flag=None)))


def test_the_map_of_modules_is_the_one_that_is_generated() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_layout.py"))["layout"]()

    assert made == (ROOT / "docs" / "layout.md").read_text(encoding="utf-8"), "run `make layout`"


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`(docs/[a-z-]+\.md)`", README))))
def test_a_page_that_it_names_exists(path: str) -> None:
    assert (ROOT / path).is_file()


@pytest.mark.parametrize("command", sorted(set(re.findall(r"^\| `arena ([a-z-]+)", README, re.MULTILINE))))
def test_a_command_that_it_names_exists(command: str) -> None:
    assert command in COMMANDS


def test_its_targets_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))

    assert set(re.findall(r"make ([a-z-]+)", README)) <= targets
