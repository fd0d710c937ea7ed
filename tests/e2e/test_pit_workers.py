"""A pit whose matches are refereed by workers, processes of their own: what comes of them, and what if one dies."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from commands import PATIENCE_S, Command
from test_monitoring import ask, ports, scrape
from test_pit import asked, journals, write_bot

from arena.records.journal import Journal

__all__ = ["ports"]

Start = Callable[..., Command]


def workers_of(pit: Any) -> list[int]:
    """Return the process ids of a pit's workers."""
    children = Path(f"/proc/{pit.process.pid}/task/{pit.process.pid}/children").read_text().split()
    return [int(child) for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


def wait_until(is_so: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < end_s, "it does not come to pass"
        time.sleep(0.02)


def is_there(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def play_four(start: Start, port: int, data: Path, *options: object) -> dict[str, Journal]:
    """Play four matches on the same maps in a pit with these options; return their journals."""
    pit = start("serve", "--listen", f"tcp/127.0.0.1:{port}", "--data", data, "--seed", 7, "--matches", 4, *options)
    address = pit.wait_for("join with: ").said.partition("pit open at ")[2].split()[0]
    clients = [
        start("join", address, "--team", team, "--policy", policy, "--slots", 2, "--forever")
        for team, policy in (("red", "rush"), ("blue", "patrol"))
    ]
    assert [process.finish() for process in (*clients, pit)] == [0, 0, 0]
    assert not list((data / "journals").glob(".spare*"))
    return {journal.header.identity: journal for journal in journals(data)}


def assert_the_same(one: dict[str, Journal], two: dict[str, Journal]) -> None:
    """Four matches were the same wherever they were refereed, and all are signed."""
    assert len(one) == 4
    assert {identity: journal.canonical for identity, journal in one.items()} == {
        identity: journal.canonical for identity, journal in two.items()
    }
    for journal in (*one.values(), *two.values()):
        assert journal.seals is not None
        assert journal.seals.signature
        assert len(journal.seals.receipts) == 2


def test_the_same_seeds_give_the_same_journals_with_one_worker_and_with_two(start: Start, port: int, tmp_path: Path) -> None:
    one = play_four(start, port, tmp_path / "one", "--fsync")
    assert_the_same(one, play_four(start, port, tmp_path / "two", "--workers", 2))


def test_workers_that_are_killed_are_replaced_and_die_with_their_pit_and_no_tick_is_lost(
    serve: Start, join: Start, ports: list[int], tmp_path: Path
) -> None:
    bot = write_bot(tmp_path, stop_at=8)
    options = ("--matches", 1, "--turn-time", 60, "--workers", 2)
    url = f"http://127.0.0.1:{ports[0]}"
    pit = serve(*options, "--metrics", f"127.0.0.1:{ports[0]}")
    red, blue = join("--team", "red", "--policy", "patrol"), join("--team", "blue", "--policy", bot).wait_for("thinking at 8")
    first = workers_of(pit)
    assert len(first) == 2

    for pid in first:
        os.kill(pid, signal.SIGKILL)
    wait_until(lambda: ask(f"{url}/healthz") == 503)
    for number in (1, 2):
        pit.wait_for(f"worker {number} was replaced")
    samples = scrape(url)
    assert [samples[f"arena_worker_restarts_total {number}"] for number in (1, 2)] == [1, 1]
    assert samples["arena_worker_matches_running 1"] + samples["arena_worker_matches_running 2"] == 1
    assert ask(f"{url}/healthz") == 200
    second = workers_of(pit)
    assert len(second) == 2
    assert not set(second) & set(first)
    os.kill(second[0], signal.SIGSTOP)
    pit.kill()
    wait_until(lambda: not any(is_there(pid) for pid in second))
    (path,) = (tmp_path / "journals").glob("*.journal")
    begun = path.read_bytes()

    pit = serve(*options).wait_for("1 unfinished matches wait for their seats to come back")
    (tmp_path / "go").touch()
    pit.wait_for("after ")
    pit.send(signal.SIGTERM)
    assert [process.finish() for process in (red, blue, pit)] == [0, 0, 0]
    (journal,) = journals(tmp_path)
    assert path.read_bytes().startswith(begun)
    assert asked(tmp_path, blue) == list(range(len(journal.ticks)))
    assert not any(mark for tick in journal.ticks for mark in tick.marks)
