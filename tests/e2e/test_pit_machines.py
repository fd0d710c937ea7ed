"""A pit whose matches are refereed on other machines, over SSH: the same bytes, and nothing lost with a machine."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from commands import Command
from machines import FarMachine, Network, far_machines, networks, ssh_of
from test_pit import asked, journals, write_bot
from test_pit_workers import wait_until

Start = Callable[..., Command]


@pytest.fixture
def machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[FarMachine]]:
    folder = tmp_path / "ssh"
    folder.mkdir()
    with far_machines(folder, 2) as found:
        monkeypatch.setenv("ARENA_SSH", ssh_of(folder))
        yield found


@pytest.fixture
def networked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[FarMachine, Network]]]:
    folder = tmp_path / "ssh"
    folder.mkdir()
    with networks(2) as within, far_machines(folder, 2, within) as found:
        monkeypatch.setenv("ARENA_SSH", ssh_of(folder))
        yield list(zip(found, within, strict=True))


def options(machines: list[FarMachine], folder: Path) -> list[object]:
    named = [word for machine in machines for word in ("--machine", f"m{machine.port}=1")]
    return ["--workers", 0, *named, "--machine-program", folder / "ssh" / "arena"]


def test_other_machines_write_the_same_journals_as_this_one(
    start: Start, port: int, machines: list[FarMachine], tmp_path: Path
) -> None:
    played = {}
    for where, more in (("here", []), ("there", [*options(machines, tmp_path), "--fsync"])):
        data = tmp_path / where
        pit = start("serve", "--listen", f"tcp/127.0.0.1:{port}", "--data", data, "--seed", 7, "--matches", 4, *more)
        address = pit.wait_for("join with: ").said.partition("pit open at ")[2].split()[0]
        clients = [
            start("join", address, "--team", team, "--policy", policy, "--slots", 2, "--forever")
            for team, policy in (("red", "rush"), ("blue", "patrol"))
        ]
        assert [process.finish() for process in (*clients, pit)] == [0, 0, 0]
        played[where] = {journal.header.identity: journal for journal in journals(data)}
        assert not list((data / "journals").glob(".spare*"))

    here, there = played["here"], played["there"]
    assert len(here) == 4
    assert {identity: one.canonical for identity, one in here.items()} == {
        identity: one.canonical for identity, one in there.items()
    }
    for journal in there.values():
        assert journal.seals is not None
        assert journal.seals.signature
        assert len(journal.seals.receipts) == 2
    wait_until(lambda: not any(machine.workers() for machine in machines))


def test_a_match_goes_on_at_its_tick_when_its_worker_or_its_machine_dies(
    serve: Start, join: Start, machines: list[FarMachine], tmp_path: Path
) -> None:
    bot = write_bot(tmp_path, stop_at=8)
    pit = serve("--matches", 1, "--turn-time", 60, *options(machines, tmp_path))
    red, blue = join("--team", "red", "--policy", "patrol"), join("--team", "blue", "--policy", bot).wait_for("thinking at 8")
    (path,) = (tmp_path / "journals").glob("*.journal")

    begun = path.read_bytes()
    for machine in machines:
        for pid in machine.workers():
            os.kill(pid, signal.SIGKILL)
    for number in (1, 2):
        pit.wait_for(f"worker {number} was replaced")
    assert "is not reached" not in pit.said
    assert path.read_bytes() == begun

    one, other = machines
    one.die()
    pit.wait_for(f"m{one.port} is not reached").wait_for(f"it is started on m{other.port}")
    wait_until(lambda: len(other.workers()) == 2)
    one.start()
    other.die()
    wait_until(lambda: len(one.workers()) == 2)
    (tmp_path / "go").touch()
    pit.wait_for("after ")
    pit.send(signal.SIGTERM)
    assert [process.finish() for process in (red, blue, pit)] == [0, 0, 0], pit.said
    (journal,) = journals(tmp_path)
    assert path.read_bytes().startswith(begun)
    assert asked(tmp_path, blue) == list(range(len(journal.ticks)))
    assert not any(mark for tick in journal.ticks for mark in tick.marks)


@pytest.mark.parametrize("how", [(), ("delay", "20ms", "5ms", "loss", "2%")], ids=["good", "netem"])
def test_nothing_is_lost_when_networks_are_cut(
    serve: Start, join: Start, networked: list[tuple[FarMachine, Network]], tmp_path: Path, how: tuple[str, ...]
) -> None:
    (one, of_one), (other, of_other) = networked
    for link in (of_one, of_other):
        if how:
            link.disturb(*how)
    bot = write_bot(tmp_path, stop_at=8)
    pit = serve("--matches", 1, "--turn-time", 60, *options([one, other], tmp_path))
    red, blue = join("--team", "red", "--policy", "patrol"), join("--team", "blue", "--policy", bot).wait_for("thinking at 8")
    (path,) = (tmp_path / "journals").glob("*.journal")
    begun = path.read_bytes()

    of_one.cut()
    pit.wait_for(f"m{one.port} is not reached").wait_for("worker 1 was replaced")
    of_one.mend()
    of_other.cut()
    pit.wait_for(f"m{other.port} is not reached").wait_for("worker 2 was replaced")
    of_other.mend()
    (tmp_path / "go").touch()
    pit.wait_for("after ")
    pit.send(signal.SIGTERM)
    assert [process.finish() for process in (red, blue, pit)] == [0, 0, 0], pit.said
    (journal,) = journals(tmp_path)
    assert path.read_bytes().startswith(begun)
    assert asked(tmp_path, blue) == list(range(len(journal.ticks)))
    assert not any(mark for tick in journal.ticks for mark in tick.marks)
