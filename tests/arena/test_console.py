"""What commands print: nothing of it is obeyed by a terminal."""

import json
import logging
import re
import sys
from datetime import datetime

import pytest

from arena.console import JsonFormatter, LineFormatter, clean, print_table, say, say_lines, set_up_logging, to_json
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


def test_a_log_of_json_has_an_object_a_line_for_all_that_goes_to_stderr(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # as in a process that begins
    monkeypatch.setattr(logging.getLogger(), "level", logging.WARNING)
    set_up_logging(0, "json")
    facts = {"event": "match ended", "match": "0123", "team": "red\x9b"}
    logging.getLogger("arena.pit").info("match %s has ended\n", 7, extra={"facts": facts})
    say("waits", "for an opponent\x1b", err=True)
    say("arena: no", err=True, level="error")
    say("a result")

    out, err = capsys.readouterr()

    assert out == "a result\n"
    assert all(letter.isprintable() for line in err.splitlines() for letter in line)
    lines = [json.loads(line) for line in err.splitlines()]
    assert [(line["level"], line["event"], line["text"]) for line in lines] == [
        ("info", "match ended", "match 7 has ended\n"),
        ("info", "said", "waits"),
        ("info", "said", "for an opponent\x1b"),
        ("error", "said", "arena: no"),
    ]
    assert lines[0].items() >= {**facts, "logger": "arena.pit"}.items()
    assert all(datetime.fromisoformat(line["time"]).tzinfo is not None for line in lines)


def test_a_log_of_json_holds_tracebacks() -> None:
    try:
        raise InputError("no")
    except InputError:
        record = logging.LogRecord("name", logging.ERROR, "", 0, "said", (), sys.exc_info())

    line = json.loads(JsonFormatter().format(record))

    assert (line["event"], line["level"]) == ("log", "error")
    assert line["traceback"].startswith("Traceback")


def test_an_error_of_several_sentences_has_a_line_for_each() -> None:
    assert str(InputError("one", "two")) == "one\ntwo"


_LEAGUE = ("rank", "entry", "Elo", "95% interval", "score", "wins", "draws", "losses", "p50 ms", "p99 ms")
_ROWS = [
    ("1 to 4", "rush", "+110", "+28 to +191", "0.650", 39, 0, 21, "2.2", "541.4"),
    ("1 to 5", "fighter", "+55", "-21 to +125", "0.575", 34, 1, 25, "2.4", "353.0"),
]


def _print_at(n_columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> list[str]:
    for name, value in {"FORCE_COLOR": "1", "NO_COLOR": "1", "COLUMNS": str(n_columns)}.items():
        monkeypatch.setenv(name, value)
    print_table(_LEAGUE, _ROWS)
    return [re.sub(r"\x1b\[\d+m", "", line) for line in capsys.readouterr().out.splitlines()]


def test_the_table_of_a_league_has_a_line_for_each_entry_at_80_columns(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = _print_at(80, monkeypatch, capsys)

    assert [line.split() for line in lines[3:5]] == [" ".join(map(str, row)).split() for row in _ROWS]
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("n_columns", [20, 60, 64, 72])
def test_a_narrow_terminal_breaks_no_word_of_a_table(
    n_columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    printed = " ".join(_print_at(n_columns, monkeypatch, capsys)).split()

    words = {word for row in (_LEAGUE, *_ROWS) for cell in row for word in str(cell).split()}
    assert words <= set(printed)


def test_what_has_no_spaces_is_broken_rather_than_cut(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "40")
    path = "/folder" * 10

    print_table(("name", "file"), [("me", path)])

    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines[2:])) <= 40
    assert "".join(line.removeprefix(" me").strip() for line in lines[3:]) == path
