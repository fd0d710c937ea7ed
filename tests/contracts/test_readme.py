"""The README and its docs keep their word."""

import ast
import re
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from arena.game.types import Action, Code, Team
from arena.observation import Observation, OwnUnit

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
LAYOUT = (ROOT / "docs" / "layout.md").read_text(encoding="utf-8")


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
    return Observation(
        tick=0, team=Team.BLUE, ground=ground, units=units, enemies=(), living=(2, 2), score=0, clock_s=None, seed=7
    )


def test_its_bot_walks_to_the_flag_that_it_sees_and_wanders_otherwise() -> None:
    [code] = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    names: dict[str, object] = {}
    exec(code, names)
    act = names["act"]
    assert callable(act)

    assert act(see(flag=(0, 3))) == [Action.NORTH, Action.EAST]
    assert all(0 <= action <= 4 for action in act(see(flag=None)))


def test_every_module_stands_in_the_layout_with_its_own_first_line() -> None:
    packages = ("arena", "clients", "policies", "tournaments")
    modules = [path for package in packages for path in (ROOT / package).rglob("*.py") if path.name != "__init__.py"]
    lines = {str(path.relative_to(ROOT)): first_line(path) for path in modules}

    assert dict(re.findall(r"^\| `([^`*]+\.py)` \| (.*) \|$", LAYOUT, re.MULTILINE)) == lines


def first_line(path: Path) -> str:
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`(docs/[a-z-]+\.md)`", README))))
def test_a_page_that_it_names_exists(path: str) -> None:
    assert (ROOT / path).is_file()


@pytest.mark.parametrize("command", sorted(set(re.findall(r"^\| `arena ([a-z-]+)", README, re.MULTILINE))))
def test_a_command_that_it_names_exists(command: str) -> None:
    assert command in entry_points(group="arena.commands").names


def test_its_targets_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))

    assert set(re.findall(r"make ([a-z-]+)", README)) <= targets
