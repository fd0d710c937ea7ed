"""What commands print: nothing of it is obeyed by a terminal."""

import json
import logging
import sys

import pytest

from arena.console import LineFormatter, clean, say, say_lines, to_json
from arena.errors import InputError


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain, ünïcode · 日本", "plain, ünïcode · 日本"),
        ("\x1b[2J", r"\x1b[2J"),
        ("one\r\ntwo", r"one\r\ntwo"),
        ("\u202eabc\u2066", r"\u202eabc\u2066"),
        ("\x9b31m\x7f", r"\x9b31m\x7f"),
        ("\udcff", r"\udcff"),
    ],
)
def test_a_text_is_one_line_that_can_be_seen(text: str, shown: str) -> None:
    assert clean(text) == shown


def test_a_line_begins_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    say("one\ntwo", "three")
    say_lines("four\n\x1bfive\n", err=True)

    assert capsys.readouterr() == ("one\\ntwo\nthree\n", "four\n\\x1bfive\n")


def test_json_says_the_same_without_what_a_terminal_obeys() -> None:
    value = {"a\x9b": ["\x7f\u202e\x1b\n", "日本"]}

    text = to_json(value)

    assert json.loads(text) == value
    assert all(letter.isprintable() or letter == "\n" for letter in text)
    assert "日本" in text


def test_what_a_stranger_sent_is_logged_cleanly() -> None:
    try:
        raise InputError("\x1b[2J")
    except InputError:
        record = logging.LogRecord("name", logging.INFO, "", 0, "said %s", ("\x1b\n",), sys.exc_info())

    text = LineFormatter("%(levelname)s %(message)s").format(record)

    assert text.startswith("INFO said \\x1b\\n\nTraceback")
    assert "\x1b" not in text


def test_an_error_of_several_sentences_has_a_line_for_each() -> None:
    assert str(InputError("one", "two")) == "one\ntwo"
