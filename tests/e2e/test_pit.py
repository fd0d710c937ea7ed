"""A pit and its clients as processes, over real Zenoh."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arena.game.types import Termination
from arena.records.journal import Journal, read_journal, whole_part
from arena.records.journal_folder import load_journal
from arena.records.replay import verify

Start = Callable[..., Any]
SLOW_BOT = '''
"""Remembers how often it was asked, and writes every question down; thinks until there is a file to go on."""

import os
import threading
from pathlib import Path

FOLDER = Path({folder!r})


class Bot:
    def __init__(self):
        self.asked = 0

    def act(self, observation):
        assert observation.tick == self.asked, "a tick was missed, or asked twice"
        self.asked += 1
        with (FOLDER / f"asked-{{os.getppid()}}").open("a") as file:
            file.write(f"{{observation.tick}}\\n")
        if observation.tick == {stop_at} and not (FOLDER / "go").exists():
            print(f"thinking at {{observation.tick}}", flush=True)
            while not (FOLDER / "go").exists():
                threading.Event().wait(0.05)
        return [observation.tick % 5] * len(observation.units)
'''


def write_bot(folder: Path, stop_at: int = -1) -> Path:
    path = folder / "slow.py"
    path.write_text(SLOW_BOT.format(folder=str(folder), stop_at=stop_at))
    return path


def asked(folder: Path, client: Any) -> list[int]:
    """Return the ticks that a process's bot was asked."""
    return [int(line) for line in (folder / f"asked-{client.process.pid}").read_text().split()]


def journals(folder: Path) -> list[Journal]:
    """Return the whole journals of a pit, each checked."""
    read = [load_journal(path) for path in sorted((folder / "journals").glob("*.journal"))]
    for journal in read:
        verify(journal)
    return read


def test_a_match_ends_in_a_result_in_all_three_terminals(serve: Start, join: Start, tmp_path: Path) -> None:
    pit = serve("--matches", 1)
    red, blue = join("--team", "red", "--policy", "rush"), join("--team", "any", "--policy", "roomba")

    assert [process.finish() for process in (red, blue, pit)] == [0, 0, 0]
    (journal,) = journals(tmp_path)
    assert journal.ending is not None
    words = {None: ("draw", "draw")}.get(journal.ending.winner, ("win", "loss") if journal.ending.winner else ("loss", "win"))
    assert f"{words[0]} as red by " in red.said
    assert f"{words[1]} as blue by " in blue.said
    assert "blue roomba, red rush: " in pit.said
    assert "anyone can try small seeds" in pit.said
    assert (journal.header.blue, journal.header.red) == ("roomba", "rush")


def test_clients_that_play_on_and_on_hear_that_the_pit_has_closed(serve: Start, join: Start) -> None:
    pit = serve("--matches", 2)
    clients = [join("--team", team, "--policy", "rush", "--forever", "--patience", 20) for team in ("red", "blue")]

    assert [process.finish() for process in (*clients, pit)] == [0, 0, 0]
    for client in clients:
        assert "no more: the pit begins no more matches" in client.said


def test_what_cannot_be_is_said_in_one_sentence(serve: Start, join: Start, start: Start, port: int, tmp_path: Path) -> None:
    serve()
    waiting = join("--team", "red", "--policy", "rush").wait_for("rush waits for an opponent")
    other_protocol = (
        "import arena.protocol.messages as m, arena.protocol.codec as c; m.PROTOCOL_VERSION = c.PROTOCOL_VERSION = 99; "
    )

    refused = {
        join("--team", "red", "--policy", "roomba"): (1, "arena: the pit says no: red is taken, by rush; try blue: it is free"),
        join("--rules", "gym-cap"): (1, "arena: the pit says no: the pit plays ruleset paper ("),
        join(code=other_protocol + "from tournaments.cli import main; main()"): (1, "the other side speaks version"),
        start("serve", "--listen", f"tcp/127.0.0.1:{port}", "--data", tmp_path / "other"): (2, "the port is in use"),
        start("serve", "--listen", "tcp/127.0.0.1:1", "--data", tmp_path): (2, "another pit keeps its journals in "),
    }
    for process, (code, sentence) in refused.items():
        assert process.finish() == code, process.said
        assert sentence in process.said
        assert len(process.said.strip().splitlines()) == 1, process.said
    assert waiting.process.poll() is None


def test_a_pit_that_is_not_there_is_said_to_be_so(serve: Start, start: Start, port: int) -> None:
    absent = start("join", f"arena://127.0.0.1:{port}/pit", "--patience", 0)
    assert absent.finish() == 1
    assert "arena: no pit answers at tcp/127.0.0.1:" in absent.said

    serve()
    misnamed = start("join", f"arena://127.0.0.1:{port}/pitt")
    assert misnamed.finish() == 1
    assert "arena: no pit called pitt answers at tcp/127.0.0.1:" in misnamed.said


def test_the_pit_may_be_opened_last(serve: Start, start: Start, port: int) -> None:
    address = f"arena://127.0.0.1:{port}/pit"
    clients = [start("join", address, "--policy", policy) for policy in ("rush", "patrol")]
    for client in clients:
        client.wait_for(f"waits for the pit at tcp/127.0.0.1:{port}")

    pit = serve("--matches", 1)

    assert [process.finish() for process in (*clients, pit)] == [0, 0, 0]
    for client in clients:
        assert client.said.count("waits for the pit at") == 1


def test_slots_of_one_team_wait_for_each_other(serve: Start, join: Start) -> None:
    pit = serve("--matches", 2)
    reds = join("--team", "red", "--policy", "rush", "--slots", 2, "--matches", 2)
    reds.wait_for("waits for an opponent")
    blue = join("--team", "blue", "--policy", "patrol", "--matches", 2)

    assert [process.finish() for process in (reds, blue, pit)] == [0, 0, 0]
    assert reds.said.count(" as red by ") == 2


def test_a_client_that_was_killed_comes_back_as_a_new_process(serve: Start, join: Start, tmp_path: Path) -> None:
    bot = write_bot(tmp_path, stop_at=8)
    pit = serve("--matches", 1, "--turn-time", 60)
    enemy = join("--team", "red", "--policy", "patrol")
    first = join("--team", "blue", "--policy", bot).wait_for("thinking at 8")

    first.kill()
    (tmp_path / "go").touch()
    second = join("--policy", bot)

    assert [process.finish() for process in (second, enemy, pit)] == [0, 0, 0]
    (journal,) = journals(tmp_path)
    assert asked(tmp_path, first) == list(range(9))
    assert asked(tmp_path, second) == list(range(len(journal.ticks)))
    assert [tick.orders[0] for tick in journal.ticks] == [tick % 5 for tick in range(len(journal.ticks))]
    assert "blue 1 vanished" in pit.said
    assert not any(mark for tick in journal.ticks for mark in tick.marks)


def test_a_referee_that_was_killed_resumes_at_the_very_tick(serve: Start, join: Start, tmp_path: Path) -> None:
    bot = write_bot(tmp_path, stop_at=8)
    options = ("--matches", 1, "--turn-time", 60)
    pit = serve(*options)
    red, blue = join("--team", "red", "--policy", "patrol"), join("--team", "blue", "--policy", bot).wait_for("thinking at 8")

    pit.kill()
    (path,) = (tmp_path / "journals").glob("*.journal")
    begun = path.read_bytes()
    (tmp_path / "go").touch()
    pit = serve(*options)
    pit.wait_for("1 unfinished matches wait for their seats to come back")
    pit.wait_for("after ")
    pit.send(signal.SIGTERM)

    assert [process.finish() for process in (red, blue, pit)] == [0, 0, 0]
    (journal,) = journals(tmp_path)
    assert len(read_journal(whole_part(begun)).ticks) == 8
    assert path.read_bytes().startswith(whole_part(begun))
    assert asked(tmp_path, blue) == list(range(len(journal.ticks)))
    assert journal.ending is not None
    assert journal.ending.ending is not Termination.FORFEIT


def test_a_pit_that_is_told_to_stop_lets_its_match_end_and_sends_guests_home(serve: Start, join: Start, tmp_path: Path) -> None:
    pit = serve("--turn-time", 60)
    bot = write_bot(tmp_path, stop_at=3)
    players = [join("--team", "red", "--policy", "rush"), join("--team", "blue", "--policy", bot).wait_for("thinking at 3")]
    guest = join("--policy", "rush", "--name", "guest").wait_for("guest waits for an opponent")

    pit.send(signal.SIGTERM)
    guest.wait_for("the pit begins no more matches")
    (tmp_path / "go").touch()

    assert [process.finish() for process in (*players, guest, pit)] == [0, 0, 0, 0]
    assert len(journals(tmp_path)) == 1


def test_a_match_that_outlasts_a_stopped_pit_is_finished_by_the_next(serve: Start, join: Start, tmp_path: Path) -> None:
    pit = serve("--turn-time", 60)
    bot = write_bot(tmp_path, stop_at=3)
    players = [join("--team", "red", "--policy", "rush"), join("--team", "blue", "--policy", bot).wait_for("thinking at 3")]

    pit.send(signal.SIGTERM)
    assert pit.finish() == 0
    (tmp_path / "go").touch()
    pit = serve("--turn-time", 60).wait_for("1 unfinished matches wait for their seats to come back")
    assert [process.finish() for process in players] == [0, 0]
    pit.send(signal.SIGTERM)

    assert pit.finish() == 0
    (journal,) = journals(tmp_path)
    assert asked(tmp_path, players[1]) == list(range(len(journal.ticks)))


def test_a_match_whose_clients_were_both_killed_ends_by_rule(serve: Start, join: Start, tmp_path: Path) -> None:
    pit = serve("--matches", 1, "--grace", 1, "--turn-time", 60)
    bot = write_bot(tmp_path, stop_at=3)
    players = [join("--team", "red", "--policy", "defend"), join("--team", "blue", "--policy", bot).wait_for("thinking at 3")]

    for player in players:
        player.kill()

    assert pit.finish() == 0
    (journal,) = journals(tmp_path)
    assert journal.ending is not None
    assert (journal.ending.ending, len(journal.ticks)) == (Termination.FORFEIT, 3)
    assert "did not come back in time" in pit.said


def test_a_policy_that_raises_is_counted_and_shows_its_first_traceback_once(serve: Start, join: Start, tmp_path: Path) -> None:
    bot = tmp_path / "raises.py"
    bot.write_text("def act(observation):\n    raise RuntimeError(f'no idea at {observation.tick}')\n")
    pit = serve("--matches", 1)
    bad, good = join("--team", "red", "--policy", bot), join("--team", "blue", "--policy", "rush")

    assert [process.finish() for process in (bad, good, pit)] == [0, 0, 0]
    (journal,) = journals(tmp_path)
    assert f"red {len(journal.ticks)} unreadable" in pit.said
    assert bad.said.count("Traceback") == 1
    assert "RuntimeError: no idea at 0" in bad.said
    assert good.said.count("Traceback") == pit.said.count("Traceback") == 0
