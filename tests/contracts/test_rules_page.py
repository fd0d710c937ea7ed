"""The rules in words, docs/reference/rules.md: each board is played, and each key of a ruleset is explained, with its value."""

import re
import tomllib
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from worlds import drawing, is_near, lay, picture, rules_for

from arena.game.engine import BatchedGame
from arena.game.observation import Observation
from arena.game.ruleset import RULESETS, Ruleset, UnitType, load, parse_overrides, to_dict
from arena.game.types import Action, Code, Team, Termination

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "rules.md").read_text(encoding="utf-8")
LETTERS = dict(zip((-1, 0, 1, 2, 3, 4, 5, 6, 7, 8), "?..UAuaFf#", strict=True))
N_GAMES = 4_000


@dataclass(frozen=True, kw_only=True)
class Example:
    """One drawn tick."""

    before: str
    after: str
    """Empty where chance decides."""
    said: dict[str, str]

    @property
    def rules(self) -> Ruleset:
        return rules_for(self.before).with_(parse_overrides(self.said.get("set", "").split()))

    def play(self, n_games: int = 1) -> BatchedGame:
        games = lay(self.rules, n_games)
        orders = [Action[word.upper()] for team in Team for word in self.said[team.name.lower()].split()]
        games.step(np.tile(np.array(orders, np.int8), (n_games, 1)))
        return games


def read(block: str) -> Example:
    lines = block.strip().splitlines()
    said = dict(re.split(r": ?", line, maxsplit=1) for line in lines if ":" in line)
    rows = [line.split() for line in lines if ":" not in line]
    before, *after = ("\n".join(column) for column in zip(*rows, strict=True))
    return Example(before=before, after="".join(after), said=said)


EXAMPLES = [read(block) for block in re.findall(r"```board\n(.*?)```", PAGE, re.DOTALL)]
PLAYED = [example for example in EXAMPLES if "blue" in example.said]


def spaced(board: str) -> str:
    return drawing("\n".join(" ".join(line) for line in board.splitlines()))


@pytest.mark.parametrize("example", [one for one in PLAYED if one.after], ids=lambda one: one.before.replace("\n", "/"))
def test_a_drawn_tick_is_what_the_game_does(example: Example) -> None:
    games = example.play()

    assert picture(games) == spaced(example.after)
    field = games.state.field[0]
    ending, winner, score = example.said.get("ends", "running nobody 0").split()
    assert Termination(field[1]).name.lower() == ending
    assert {-1: "nobody", 0: "blue", 1: "red"}[int(field[2])] == winner
    assert int(field[3]) == int(score)


@pytest.mark.parametrize("example", [one for one in PLAYED if not one.after], ids=lambda one: one.said["falls"])
def test_units_fall_as_often_as_the_page_says(example: Example) -> None:
    games = example.play(N_GAMES)
    chances = [Fraction(word) for word in example.said["falls"].split() if "/" in word]

    fallen = (games.state.alive == 0).mean(axis=0)
    assert len(fallen) == len(chances)
    assert all(is_near(often, float(chance), N_GAMES) for often, chance in zip(fallen, chances, strict=True))


@pytest.mark.parametrize("example", [one for one in EXAMPLES if one not in PLAYED], ids=lambda one: one.before[:8])
def test_a_team_sees_what_the_page_shows(example: Example) -> None:
    assert "blue sees" in example.said
    seen: Observation = lay(example.rules).observe()[Team.BLUE].seat(0, example.rules)

    assert "\n".join("".join(LETTERS[code] for code in row) for row in seen.grid.tolist()) == example.after


def test_every_kind_of_example_is_drawn() -> None:
    assert len(EXAMPLES) >= 7
    assert {"falls", "ends", "set", "blue sees"} <= set(chain.from_iterable(example.said for example in EXAMPLES))


def table(*columns: str) -> dict[str, list[str]]:
    """Return the rows of the page's table with these columns first, by their first cell."""
    head = "| " + " | ".join(columns) + " |"
    [text] = [part for part in PAGE.split("\n\n") if part.startswith(head)]
    rows = [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in text.splitlines()[2:]]
    return {row[0]: row[1:] for row in rows}


def test_every_key_of_a_ruleset_is_explained_with_its_value() -> None:
    keys, paper = table("key", "`paper`"), to_dict(load("paper"))

    assert set(keys) == {item.name for item in fields(Ruleset)} - {"name"} | {"base"}
    for key, (value, meaning) in keys.items():
        assert meaning
        assert key not in paper or not value or tomllib.loads(f"value = {value}")["value"] == paper[key], key


def test_every_key_of_a_unit_type_is_explained_with_its_values() -> None:
    keys, units = table("key of a unit type"), to_dict(load("paper"))["units"]

    assert set(keys) == {item.name for item in fields(UnitType)} - {"name"}
    for key, (*values, meaning) in keys.items():
        assert meaning
        assert [tomllib.loads(f"value = {value}")["value"] for value in values] == [units["ugv"][key], units["uav"][key]], key


def test_every_ruleset_and_every_code_is_named() -> None:
    assert tuple(table("name")) == RULESETS
    for code in Code:
        words = code.name.lower().replace("_", " ").replace("ugv", "UGV").replace("uav", "UAV")
        assert re.search(rf"\s{int(code)} {words}[,.]", PAGE), words
