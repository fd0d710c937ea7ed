"""docs/reference/league-file.md keeps its word: every key of a league's file is there, with the default that it has."""

import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from pages import PAGES

from arena.sandbox.limits import BEHIND_A_WALL
from tournaments.league.file import _KEYS, parse_league
from tournaments.league.league import BOUNDS, League
from tournaments.league.season import SeasonTerms
from tournaments.league.template import TEMPLATE

PAGE = PAGES["docs/reference/league-file.md"]
SMALL = 'entries = ["rush", "patrol"]\n'


def table(title: str) -> dict[str, str]:
    """Return the default of each key in the first table under a title, as the page writes it."""
    section = PAGE.partition(f"\n{title}\n")[2].partition("\n## ")[0]
    return dict(re.findall(r"^\| `(\w+)` \| (.*?) ?\|", section, re.MULTILINE))


KEYS = table("| key | default | meaning |\n|---|---|---|")
VALUES = {key: found[1] for key, default in KEYS.items() if (found := re.fullmatch(r"`(.+)`", default))}


def read(text: str) -> League:
    return parse_league(text, "small", Path())


def value_of(default: str) -> Any:
    return tomllib.loads(f"value = {default}")["value"]


def test_every_key_is_there_and_no_other() -> None:
    assert sorted(KEYS) == sorted(_KEYS)


@pytest.mark.parametrize("key", VALUES)
def test_a_key_with_its_default_changes_nothing(key: str) -> None:
    assert read(f"{key} = {VALUES[key]}\n{SMALL}") == read(SMALL)


@pytest.mark.parametrize("key", ["pairs", "turn_time_s", "bank_s", "grace_s"])
def test_another_value_does_change_something(key: str) -> None:
    assert read(f"{key} = {value_of(VALUES[key]) + 1}\n{SMALL}") != read(SMALL)


def test_every_limit_is_there_with_its_default() -> None:
    limits = table("## `[limits]`")

    assert [f"{key}={value_of(default.strip('`'))}" for key, default in limits.items()] == BEHIND_A_WALL.assignments()


def test_every_term_of_a_season_is_there_with_its_default() -> None:
    terms = {key: default.strip("`") for key, default in table("## `[season]`").items()}
    known = {field.name.removesuffix("_s"): field.default for field in fields(SeasonTerms)}

    assert {key: None if default == "none" else value_of(default) for key, default in terms.items()} == known


def test_every_bound_of_a_test_is_there_with_its_default() -> None:
    test = read(f'pairing = "sprt"\n{SMALL}').sprt
    bounds = {key: value_of(default.strip("`")) for key, default in table("## `[sprt]`").items()}

    assert bounds == {name: getattr(test, name) for name in BOUNDS}


def test_what_init_writes_names_every_key() -> None:
    named = set(re.findall(r"^(?:# )?\[?(\w+)(?: =|\]|\.)", TEMPLATE, re.MULTILINE)) | {
        "challenger" if "challenger =" in TEMPLATE else ""
    }

    assert set(_KEYS) - named <= {"secret"}
