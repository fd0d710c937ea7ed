"""Where a bot is, in words; and before each line that it prints."""

# ruff: noqa: T201 - bots print

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from io import StringIO

import pytest

from arena import current_call
from arena.game.types import Team

ASKED = ("/arena/asks.py", 7, "_call")


@contextmanager
def printing() -> Iterator[StringIO]:
    """Mark what bots print, into a text."""
    text = StringIO()
    with redirect_stderr(text), current_call.marked_prints():
        yield text


BLUE, RED = (current_call.Place("m", team) for team in Team)


def ask(tick: int) -> None:
    current_call.begin(BLUE, tick)


def test_each_line_that_a_bot_prints_says_where_it_was_printed() -> None:
    with printing() as text:
        ask(12)
        print("one\ntwo")
        print("to stderr", file=sys.stderr)
        current_call.end()
        current_call.begin(RED, current_call.START)
        print("three")
        current_call.end()

    assert text.getvalue() == (
        "[m blue tick 12] one\n[m blue tick 12] two\n[m blue tick 12] to stderr\n[m red the start] three\n"
    )


def test_a_line_in_pieces_has_one_mark_and_ends_with_its_tick() -> None:
    with printing() as text:
        for tick in (1, 2):
            ask(tick)
            print("a", end="")
            print("b", "c", end="", flush=True)
            current_call.end()
        print("ours")
        ask(3)
        print()
        print("\n\nd")
        current_call.end()

    assert text.getvalue() == "[m blue tick 1] ab c\n[m blue tick 2] ab c\nours\n\n\n\n[m blue tick 3] d\n"


def test_junk_is_shown_and_not_obeyed() -> None:
    with printing() as text:
        ask(1)
        sys.stdout.buffer.write(b"\x1b[2Jhi\xff\r\n\ttab\n")
        current_call.end()

    assert text.getvalue() == "[m blue tick 1] \\x1b[2Jhi\ufffd\n[m blue tick 1]         tab\n"


def test_what_no_bot_prints_passes_as_it_is() -> None:
    with printing() as text:
        print("\x1b[1mours\x1b[0m\t", end="")

    assert text.getvalue() == "\x1b[1mours\x1b[0m\t"


def test_a_stack_is_told_from_the_bot_s_own_file_inwards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(current_call, "OURS", {ASKED[0]})
    inner = [("/lib/deep.py", n, f"f{n}") for n in range(9, 0, -1)]

    told = current_call.tell(
        "tick 3 of match m as blue", [*inner, ("/my/bot.py", 5, "act"), ASKED, ("/arena/venue.py", 1, "<module>")]
    )

    assert told.splitlines() == [
        "bot.py is at tick 3 of match m as blue: line 5 in act",
        "    ...",
        *(f"    deep.py, line {n} in f{n}" for n in range(5, 10)),
    ]


def test_of_a_program_it_is_told_what_it_was_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(current_call, "OURS", {ASKED[0]})

    assert (
        current_call.tell("tick 3 of match m as blue", [ASKED])
        == "a bot was asked at tick 3 of match m as blue, and has not answered"
    )
