"""An author plays a match tick by tick at a real terminal."""

from collections.abc import Callable
from pathlib import Path

import pytest
from terminals import Terminal

from arena.records.journal_folder import load_journal

BOT = """
def act(observation):
    print("thinking of", observation.tick)
    observation.log("seen", len(observation.enemies), "enemies")
    observation.draw.path([(0, 0), (0, 1)], "green")
    return [observation.tick % 5] * len(observation.units)
"""


@pytest.mark.usefixtures("compiled")
def test_a_match_is_played_as_keys_are_pressed(terminal: Callable[..., Terminal], tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(BOT)
    screen = terminal(
        "play", tmp_path / "mine.py", "squad", "--step", "--seed", 1, "--set", "tick_limit=12", "--journals", tmp_path / "kept"
    )
    before = screen.mode

    screen.wait_for("paused  tick 0 of ?")
    screen.wait_for("printed: thinking of 0")
    assert "thinking of 1" not in screen.said
    screen.press("\x1b[C")
    screen.wait_for("printed: thinking of 1")
    screen.press("\x1b[D\x1b[F")
    screen.wait_for("paused  tick 12 of 12")
    assert "enemies" in screen.said
    screen.press("q")

    assert screen.read_to_the_end() == 0
    assert screen.mode == before
    [path] = (tmp_path / "kept").glob("*.journal")
    ending = load_journal(path).ending
    assert ending is not None
    assert screen.said.rstrip().endswith(f"blue mine against red squad: {ending.describe()}")
