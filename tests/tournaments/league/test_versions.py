"""Versions of an entry: what is a new one, and what it is called."""

import re
from pathlib import Path

import pytest

from arena.protocol.topics import check_label, is_label
from tournaments.league.file import parse_league
from tournaments.league.versions import Version, entry_of, label_of, match_versions, number_of, successions, with_labels

ONE, OTHER = ("mine.py " + 64 * digit for digit in "ab")
KNOWN = [
    Version(entry="mine", number=2, fingerprint=OTHER),
    Version(entry="mine", number=1, fingerprint=ONE),
    Version(entry="rush", number=1, fingerprint="rush"),
]


def labels(entries: dict[str, str]) -> dict[str, str]:
    return {version.entry: version.label for version in match_versions(entries, KNOWN)}


def test_new_code_is_the_next_version_and_old_code_the_one_that_it_was() -> None:
    assert labels({"mine": "mine.py " + 64 * "c", "rush": "rush"}) == {"mine": "mine.3", "rush": "rush"}
    assert labels({"mine": ONE}) == {"mine": "mine"}
    assert labels({"mine": OTHER}) == {"mine": "mine.2"}
    assert labels({"new": ONE}) == {"new": "new"}


def test_a_file_that_was_renamed_is_the_same_code_and_a_policy_that_was_exchanged_is_not() -> None:
    assert labels({"mine": ONE.replace("mine", "best")}) == {"mine": "mine"}
    assert labels({"rush": "patrol"}) == {"rush": "rush.2"}


@pytest.mark.parametrize(("label", "entry", "number"), [("a", "a", 1), ("a.2", "a", 2), ("a-b_1.10", "a-b_1", 10)])
def test_a_label_says_the_entry_and_the_number(label: str, entry: str, number: int) -> None:
    assert (entry_of(label), number_of(label)) == (entry, number)
    assert label_of(entry, number) == label
    assert check_label("the name", label) == label


@pytest.mark.parametrize(
    "label", ["", ".", "..", ".2", "a.", "a.0", "a.02", "a.b", "a.2.3", "a/2", "a.1234567", 65 * "a", "a.2\n"]
)
def test_what_is_no_label_is_refused(label: str) -> None:
    assert not is_label(label)


def test_a_challenger_is_called_as_its_version_is() -> None:
    definition = {"entries": {"a": "1", "b": "2"}, "challenger": "a", "rules": "r"}

    assert with_labels(definition, {"a": "a.4", "b": "b"}) == {
        "entries": {"a.4": "1", "b": "2"}, "challenger": "a.4", "rules": "r",
    }  # fmt: skip


def test_a_programs_files_are_its_code_and_the_interpreter_of_the_machine_is_not(tmp_path: Path) -> None:
    (tmp_path / "bot.js").write_text("1")
    text = 'maps = "fresh"\n[entries]\nmine = "exec:/bin/sh bot.js"\nrush = "rush"'

    def fingerprint() -> str:
        return str(parse_league(text, "friday", tmp_path).definition["entries"]["mine"])

    before = fingerprint()
    (tmp_path / "bot.js").write_text("2")

    assert re.fullmatch("exec:/bin/sh bot.js [0-9a-f]{64}", before)
    assert fingerprint() != before
    known = [Version(entry="mine", number=1, fingerprint="exec:/bin/sh bot.js")]
    assert [one.label for one in match_versions({"mine": before}, known)] == ["mine"]  # of a store from before files counted


def test_each_version_follows_the_one_before_it_that_is_there() -> None:
    labels = ["mine.10", "mine", "rush", "mine.9", "lost.2", "lost.4"]

    assert set(successions(labels)) == {("mine", "mine.9"), ("mine.9", "mine.10"), ("lost.2", "lost.4")}
