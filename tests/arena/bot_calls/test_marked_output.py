"""Match, team and tick before each line that a bot prints."""

# ruff: noqa: T201 - bots print

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from io import StringIO

from arena.bot_calls.current import START, Place, begin, end
from arena.bot_calls.marked_output import marked_prints
from arena.game.types import Team


@contextmanager
def printing() -> Iterator[StringIO]:
    """Mark what bots print, into a text."""
    text = StringIO()
    with redirect_stderr(text), marked_prints():
        yield text


BLUE, RED = (Place("m", team) for team in Team)


def ask(tick: int) -> None:
    begin(BLUE, tick)


def test_each_line_that_a_bot_prints_says_where_it_was_printed() -> None:
    with printing() as text:
        ask(12)
        print("one\ntwo")
        print("to stderr", file=sys.stderr)
        end()
        begin(RED, START)
        print("three")
        end()

    assert text.getvalue() == (
        "[m blue tick 12] one\n[m blue tick 12] two\n[m blue tick 12] to stderr\n[m red the start] three\n"
    )


def test_a_line_in_pieces_has_one_mark_and_ends_with_its_tick() -> None:
    with printing() as text:
        for tick in (1, 2):
            ask(tick)
            print("a", end="")
            print("b", "c", end="", flush=True)
            end()
        print("ours")
        ask(3)
        print()
        print("\n\nd")
        end()

    assert text.getvalue() == "[m blue tick 1] ab c\n[m blue tick 2] ab c\nours\n\n\n\n[m blue tick 3] d\n"


def test_junk_is_shown_and_not_obeyed() -> None:
    with printing() as text:
        ask(1)
        sys.stdout.buffer.write(b"\x1b[2Jhi\xff\r\n\ttab\n")
        end()

    assert text.getvalue() == "[m blue tick 1] \\x1b[2Jhi\ufffd\n[m blue tick 1]         tab\n"


def test_what_no_bot_prints_passes_as_it_is() -> None:
    with printing() as text:
        print("\x1b[1mours\x1b[0m\t", end="")

    assert text.getvalue() == "\x1b[1mours\x1b[0m\t"
