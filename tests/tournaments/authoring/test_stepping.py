"""A match that is played as somebody looks at it is the match that `arena play` plays."""

import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from arena.display.player import Recording
from arena.display.scene import scenes_of_journal
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team
from arena.local.venue import play_batch
from arena.records.journal import read_journal
from policies.registry import load_entry
from tournaments.authoring.captured_output import captured_output
from tournaments.authoring.stepping import SteppedPlay
from tournaments.fixture import plan_fixture

RULES = load("paper").with_({"side": 10, "tick_limit": 30})
BOT = """
def act(observation):
    observation.log("at tick", observation.tick)
    observation.draw.cell(1, 2, "red", "A")
    print("hello from", observation.tick)
    if observation.tick == 2:
        return [1]
    return [observation.tick % 5] * len(observation.units)
"""


@pytest.fixture
def bot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "stepped.py").write_text(BOT)
    return tmp_path / "stepped.py"


def test_it_is_the_match_that_is_played_at_once_and_no_further_than_it_is_looked_at(bot: Path) -> None:
    loader = partial(load_entry, {"mine": str(bot), "squad": "squad"})
    [plan, _] = plan_fixture("play", "mine", "squad", 1, secret_from_seed(5))
    match = SteppedPlay(RULES, plan, loader, Team.BLUE, list)
    recording = Recording(match.scenes())

    first = recording.find(1)
    assert (match.record, len(recording)) == (None, 2)
    assert recording.find(10_000) is None

    [record] = play_batch(RULES, [plan], loader("mine"), loader("squad"))
    assert match.record == record
    assert first is not None
    assert (first.log, first.drawings) == (("at tick 1",), [{"cell": [1, 2], "colour": "red", "text": "A"}])
    assert [label for label, pane in first.panes.items() if pane.is_drawn_on] == ["what blue sees"]
    assert record.journal is not None
    for number, scene in enumerate(scenes_of_journal(read_journal(record.journal))):
        shown = recording.find(number)
        assert shown is not None
        assert (shown.title, shown.units, shown.fought, shown.is_event) == (
            scene.title,
            scene.units,
            scene.fought,
            scene.is_event,
        )
        assert ("stay (unreadable)" in {unit.order for unit in shown.units}) == (number == 2)


def test_what_is_printed_is_kept_aside_by_whatever_means(capfd: pytest.CaptureFixture[str]) -> None:
    with captured_output() as kept:
        os.write(1, b"one\n")
        os.write(2, b"two\n")
        subprocess.run(["echo", "three"], check=True)
        first = kept.take()
        os.write(1, b"x" * 20_000)
        second = kept.take()
        kept.terminal.write("to the terminal\n")
        kept.terminal.flush()
    os.write(1, b"after\n")

    assert first == ["one", "two", "three"]
    assert [len(line) for line in second] == [1 << 14, len("(3,616 more bytes)")]
    assert capfd.readouterr().out == "to the terminal\nafter\n"


def test_step_wants_a_terminal_and_one_match(here: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    done = here("play", "rush", "squad", "--step")
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert "--step wants a terminal" in done.stderr
    assert "leave out --pairs, --json" in here("play", "rush", "squad", "--step", "--json").stderr
