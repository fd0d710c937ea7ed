"""An author stops inside a bot at a tick of a match that was lost, at a real terminal."""

from collections.abc import Callable
from pathlib import Path

from commands import run_here
from terminals import Terminal

BOT = """
def act(observation):
    order = observation.tick % 5
    return [order] * len(observation.units)
"""


def test_pdb_stops_inside_act_at_the_tick(terminal: Callable[..., Terminal], tmp_path: Path) -> None:
    bot = tmp_path / "mine.py"
    bot.write_text(BOT)
    run_here("play", bot, "rush", "--pairs", 1, "--seed", 2, "--set", "tick_limit=12", "--journals", tmp_path / "kept")
    [journal] = (tmp_path / "kept").glob("*mine-blue*")
    screen = terminal("debug", journal, "--policy", bot, "--tick", 7)

    screen.wait_for("-> order = observation.tick % 5")
    screen.wait_for("(Pdb) ")
    screen.press("p 'tick', observation.tick\n")
    screen.wait_for("('tick', 7)")
    screen.press("n\np 'order', order\n")
    screen.wait_for("('order', 2)")
    screen.press("c\n")

    assert screen.read_to_the_end() == 0
    assert "its orders are those that were played" in screen.said
