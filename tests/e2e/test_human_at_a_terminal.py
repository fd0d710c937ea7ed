"""A person at a real terminal, in a real pit, against patrol."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from terminals import Terminal

from arena.records.journal_folder import load_journal
from arena.records.replay import verify

Start = Callable[..., Any]


def test_a_person_plays_a_match_against_patrol_to_its_end(
    serve: Start, join: Start, terminal: Callable[..., Terminal], port: int, tmp_path: Path
) -> None:
    pit = serve("--matches", 1, "--humans")
    join("--team", "blue", "--policy", "patrol")
    screen = terminal(
        "join", f"arena://127.0.0.1:{port}/pit", "--team", "red", "--policy", "human", "--autopilot", "rush", "--name", "me"
    )
    for text in ("s left", "tick 0 of 100", "You are red against patrol"):  # a screen is painted in pieces
        screen.wait_for(text)
    screen.press("1w2\t")
    while "Press Enter to go on" not in screen.said:
        screen.press("\r")  # its every answer is a sign that it may be pressed again
        assert screen.read()
    screen.press("\r")

    assert (screen.read_to_the_end(), pit.finish()) == (0, 0)
    [path] = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert journal.header.red == "me"
    assert verify(journal) == len(journal.ticks)
    assert not any(mark for tick in journal.ticks for mark in tick.marks)
    assert re.search(rf"match \w+: (win|loss|draw) as red by .* after {len(journal.ticks)} ticks, score", screen.said)


def test_a_key_changes_what_the_pit_is_sent(
    serve: Start, join: Start, terminal: Callable[..., Terminal], port: int, tmp_path: Path
) -> None:
    pit = serve("--matches", 1, "--humans", "--set", "tick_limit=2", "--set", "obstacles=false")
    join("--team", "blue", "--policy", "patrol")
    screen = terminal("join", f"arena://127.0.0.1:{port}/pit", "--team", "red", "--policy", "human", "--name", "me")
    screen.wait_for("s left")
    screen.press("4w\r")
    screen.wait_for("tick 1 of 2")
    screen.press("\r")
    screen.wait_for("Press Enter to go on")
    screen.press("\r")
    screen.read_to_the_end()

    assert pit.finish() == 0
    [path] = (tmp_path / "journals").glob("*.journal")
    assert [list(tick.orders[6:]) for tick in load_journal(path).ticks] == [[0, 0, 0, 0, 1, 0]] * 2


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--policy", "human"), "--policy human wants a terminal"),
        (("--policy", "patrol", "--autopilot", "rush"), "--autopilot is for --policy human"),
        (("--policy", "human", "--limit", "memory_mb=500"), "--sandbox and --limit are for fighters, and --policy human is you"),
        (("--policy", "rush", "--limit", "foo=1"), "unknown limit 'foo'"),
    ],
)
def test_what_no_person_can_play_with_is_one_sentence(start: Start, arguments: tuple[str, ...], says: str) -> None:
    joined = start("join", *arguments)

    assert joined.finish() == 2
    assert says in joined.said
    assert len(joined.said.splitlines()) == 1
