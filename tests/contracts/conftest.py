"""What the arena did before, kept as files; a test compares what it does now, byte by byte."""

import os
from collections.abc import Callable
from difflib import unified_diff
from itertools import islice
from pathlib import Path

import pytest

from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import Ruleset, load
from arena.local.venue import MatchPlan, play_batch
from arena.records.journal import Journal, read_journal
from policies.registry import load as load_fighter

FIXTURES = Path(__file__).parent / "fixtures"
IS_WRITING = os.environ.get("ARENA_WRITE_FIXTURES") == "1"
MOST_TOLD, MOST_LETTERS = 30, 160
"""Lines of a difference, and letters of each."""
ADVICE = """
A change of behaviour that is meant: write what is kept anew by

    ARENA_WRITE_FIXTURES=1 .venv/bin/pytest tests/contracts/test_same_*.py

read the difference by `git diff tests/contracts/fixtures`, and name the change in CHANGELOG.md."""
SMALL_BOARD = """
F..u
U...
..A.
a..f
"""


@pytest.fixture
def same() -> Callable[[str, str], None]:
    """Compare a text with the one that is kept under a name; or keep it, where ARENA_WRITE_FIXTURES=1 asks for that."""

    def compare(name: str, now: str) -> None:
        path = FIXTURES / name
        if IS_WRITING:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(now.encode())
            return
        if not path.is_file():
            pytest.fail(f"{path.name} is not there, so nothing tells whether this is as before\n{ADVICE}", pytrace=False)
        before = path.read_bytes().decode()
        if now != before:
            lines = unified_diff(before.splitlines(), now.splitlines(), "before", "now", n=0, lineterm="")
            told = "\n".join(line[:MOST_LETTERS] for line in islice(lines, MOST_TOLD)) or "(only in how lines end)"
            pytest.fail(f"{name} differs from what is kept:\n\n{told}\n{ADVICE}", pytrace=False)

    return compare


@pytest.fixture
def recorded() -> Callable[[str, Callable[[], str]], str]:
    """Return what was kept once; what differs at each time is made anew only where it is not there."""

    def find(name: str, make: Callable[[], str]) -> str:
        path = FIXTURES / name
        if IS_WRITING and not path.is_file():
            path.write_text(make() + "\n")
        if not path.is_file():
            pytest.fail(f"{name} is not there\n{ADVICE}", pytrace=False)
        return path.read_text().strip()

    return find


def make_plan(identity: str, blue: str, red: str, seed: int, fixture: str = "", pair: int = 0) -> MatchPlan:
    """Plan a match whose keys follow from its names and a seed."""
    secret = secret_from_seed(seed)
    keys = MatchKeys(map_key=derive_map_key(secret, fixture or identity, pair), match_key=derive_match_key(secret, identity))
    return MatchPlan(identity=identity, blue=blue, red=red, keys=keys)


@pytest.fixture(scope="session")
def plan() -> Callable[..., MatchPlan]:
    return make_plan


@pytest.fixture(scope="session")
def small_rules() -> Ruleset:
    """Return rules under which a match is so short that all of it can be kept and read."""
    return load("paper").with_({"board": SMALL_BOARD, "tick_limit": 8})


@pytest.fixture(scope="session")
def small_journal(small_rules: Ruleset) -> bytes:
    """Return the journal of a match of five ticks."""
    fighter = load_fighter("random")
    [record] = play_batch(small_rules, [make_plan("small/18", "random", "random", 1)], fighter, fighter)
    assert record.journal is not None
    return record.journal


@pytest.fixture(scope="session")
def small(small_journal: bytes) -> Journal:
    return read_journal(small_journal)
