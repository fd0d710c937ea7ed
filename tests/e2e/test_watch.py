"""`arena watch` beside a real match: everyone hears the facts, and who has the pit's spectator key sees the truth."""

import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arena.display.text import draw_board
from arena.game.types import Team
from arena.keyring.files import load_or_make_secret
from arena.network.address import free_port
from arena.records.journal_folder import load_journal
from arena.records.replay import replay

Start = Callable[..., Any]
SIDE = 10
N_TICKS = 200
BOT = """
import threading
from pathlib import Path


def act(observation):
    if observation.tick == 0:
        print("begun", flush=True)
    if not Path({go!r}).exists():  # slow, until whoever watches was heard to watch
        threading.Event().wait(0.25)
    return [3 if observation.tick % 2 else 1] * len(observation.units)
"""


def boards(said: str) -> dict[int, list[str]]:
    """Return the rows of the three boards that were printed of each tick."""
    found: dict[int, list[str]] = {}
    for piece in re.split(r"^(?=match \w+   blue )", said, flags=re.MULTILINE):
        title = re.match(r"match \w+   blue .* against red .*   tick (\d+)   score", piece)
        if title:
            lines = piece.splitlines()
            assert re.fullmatch(r"what blue sees +the truth +what red sees", lines[1]), lines[1]
            found[int(title[1])] = lines[2 : 2 + SIDE]
    return found


def drawn(*grids: Any) -> list[str]:
    """Return the rows of boards side by side, as lines without colours and without blanks at their ends."""
    boards = [draw_board(grid, is_wide=True).plain.split("\n") for grid in grids]
    return ["   ".join(row).rstrip() for row in zip(*boards, strict=True)]


def test_everyone_hears_the_facts_by_a_relay_too_and_who_has_the_key_sees_both_views_and_the_truth(
    serve: Start, join: Start, start: Start, port: int, tmp_path: Path
) -> None:
    bot, go = tmp_path / "slow.py", tmp_path / "go"
    bot.write_text(BOT.format(go=str(go)))
    address, relay_port = f"arena://127.0.0.1:{port}/pit", free_port()
    key = tmp_path / "keys" / "spectator.key"
    pit = serve("--matches", 1, "--turn-time", 60, "--set", f"side={SIDE}", "--set", f"tick_limit={N_TICKS}")

    relay = start("relay", address, "--listen", f"tcp/127.0.0.1:{relay_port}").wait_for("watch with: ")
    without = start("watch", "--pit", f"arena://127.0.0.1:{relay_port}/pit")  # before there is anything to be seen
    players = [join("--team", team, "--policy", bot, "--name", name) for team, name in (("blue", "ann"), ("red", "bob"))]
    match = players[0].wait_for("begun").said.partition("match ")[2].partition(":")[0]
    sees = start("watch", "--pit", address, "--match", match, "--spectator-key", key)
    elsewhere = start("watch", "--pit", address, "--match", "0123456789abcdef")
    for watcher in (without, sees):
        watcher.wait_for("   tick ")
    assert elsewhere.finish() == 1
    go.touch()

    assert [process.finish() for process in (without, sees, *players, pit)] == [0] * 5
    relay.wait_for("; looking for it")
    relay.send(signal.SIGTERM)
    assert relay.finish() == 0
    assert f"watch with: arena watch --pit arena://127.0.0.1:{relay_port}/pit#" in relay.said
    assert "arena: match 0123456789abcdef does not run in pit" in elsewhere.said
    (journal,) = map(load_journal, (tmp_path / "journals").glob("*.journal"))
    assert journal.name == match
    assert journal.ending is not None
    assert journal.ending.ticks == N_TICKS
    winner = "draw" if journal.ending.winner is None else f"{journal.ending.winner.name.lower()} wins"
    for watcher in (without, sees):
        lines = watcher.said.splitlines()
        assert lines[-1] == f"{winner} by tick limit after {N_TICKS} ticks, score {journal.ending.score:+d} for blue"
        assert any(line.startswith(f"match {match}   blue ann against red bob   tick {N_TICKS - 1}   ") for line in lines)
    assert "truth" not in without.said
    assert "sees" not in without.said
    assert {line.partition(" ")[0] for line in without.said.splitlines()} <= {"match", "this", "draw", "no"}
    seen = boards(sees.said)
    assert N_TICKS - 1 in seen
    for number, games in enumerate(replay(journal)):
        if number in seen:
            blue, red = (games.grids()[team, 0] for team in Team)
            assert seen[number] == drawn(blue, games.truth(0), red)


def test_a_key_file_that_holds_none_is_said_before_anybody_is_asked(start: Start, tmp_path: Path) -> None:
    junk, open_to_all = tmp_path / "junk.key", tmp_path / "open.key"
    junk.write_text("no key")
    junk.chmod(0o600)
    load_or_make_secret(open_to_all)
    open_to_all.chmod(0o644)
    tried = {
        junk: "holds no secret of 43 letters",
        open_to_all: "can be read by others; chmod 600 it",
        tmp_path / "absent.key": "there is no key file",
    }
    watchers = {path: start("watch", "--pit", "arena://127.0.0.1:1/pit", "--spectator-key", path) for path in tried}

    for path, watcher in watchers.items():
        assert watcher.finish() == 2
        assert tried[path] in watcher.said
        assert len(watcher.said.splitlines()) == 1, watcher.said
