"""Somebody steps through a match at a real terminal."""

import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import run_here
from terminals import Terminal

from arena.display.scene import scenes_of_journal
from arena.records.journal_folder import load_journal

Open = Callable[..., Terminal]
LEFT_ITS_SCREEN = "\x1b[?1049l"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("journals")
    run_here("play", "rush", "squad", "--pairs", 1, "--seed", 3, "--journals", folder)
    return min(folder.glob("*.journal"))


def test_keys_step_through_a_journal_and_leave_the_terminal_as_it_was(
    terminal: Open, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")  # as a shell may have it, from before the window was made larger
    scenes = list(scenes_of_journal(load_journal(file)))
    event, last = next(scene.tick for scene in scenes if scene.is_event), len(scenes) - 1
    screen = terminal("replay", "show", file)
    before = screen.mode
    screen.wait_for(" a second  view blue")

    for keys, shown in [
        ("\x1b[H", f"paused  tick 0 of {last}"),
        ("\x1b[C\x1b[C\x1b[D", f"paused  tick 1 of {last}"),
        ("\x1b[Hn", f"paused  tick {event} of {last}"),
        ("v", "view red"),
        ("?", "the next fight, fall or capture"),
        ("?\x1b[F", f"paused  tick {last} of {last}"),
        ("\x1b[H+", f"paused  tick 0 of {last}  16 a second"),
    ]:
        screen.press(keys)
        screen.wait_for(shown)
    assert screen.mode != before
    screen.resize(40, 130)
    screen.process.send_signal(signal.SIGWINCH)
    screen.wait_for("u0")  # cells are wide enough for a letter and a number
    screen.press("q")

    assert screen.read_to_the_end() == 0
    ending = load_journal(file).ending
    assert ending is not None
    assert screen.said.partition(LEFT_ITS_SCREEN)[2].strip().endswith(ending.describe())
    assert screen.mode == before


def test_a_player_that_is_ended_leaves_the_terminal_as_it_was(terminal: Open, file: Path) -> None:
    screen = terminal("replay", "show", file)
    before = screen.mode
    screen.wait_for("tick 0 of")

    screen.process.send_signal(signal.SIGTERM)

    assert screen.read_to_the_end() == 128 + signal.SIGTERM
    assert LEFT_ITS_SCREEN in screen.said
    assert screen.mode == before


def test_plain_output_needs_no_keys(terminal: Open, file: Path) -> None:
    screen = terminal("replay", "show", file, "--plain")

    assert screen.read_to_the_end() == 0
    assert "\x1b" not in screen.said
    assert screen.said.count("what blue sees") == len(load_journal(file).ticks) + 1
