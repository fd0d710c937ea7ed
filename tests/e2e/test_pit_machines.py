"""A pit whose matches are refereed on other machines, over SSH: the same bytes, and nothing lost with a machine."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from commands import Command
from test_pit import asked, journals, write_bot
from test_pit_workers import assert_the_same, play_four, wait_until

from arena.errors import ArenaError
from benchmarks.measuring.machines import FarMachine, Network, far_machines, networks, program_of, ssh_of

Start = Callable[..., Command]


@pytest.fixture
def machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[FarMachine]]:
    with ExitStack() as opened:
        yield open_machines(opened, tmp_path, monkeypatch)


@pytest.fixture
def networked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[FarMachine, Network]]]:
    with ExitStack() as opened:
        with lacking_is_told():
            within = opened.enter_context(networks(2))
        yield list(zip(open_machines(opened, tmp_path, monkeypatch, within), within, strict=True))


def open_machines(
    opened: ExitStack, folder: Path, monkeypatch: pytest.MonkeyPatch, within: Sequence[Network] = ()
) -> list[FarMachine]:
    monkeypatch.setenv("ARENA_SSH", ssh_of(folder / "ssh"))
    with lacking_is_told():
        return opened.enter_context(far_machines(folder / "ssh", 2, within))


@contextmanager
def lacking_is_told() -> Iterator[None]:
    """Skip a test that this machine cannot run; it fails for want of an SSH server where every test must run."""
    try:
        yield
    except ArenaError as error:
        if os.environ.get("ARENA_REQUIRE_ALL") and "SSH server" in str(error):
            pytest.fail(f"{error}, and ARENA_REQUIRE_ALL=1 allows no test to be skipped")
        pytest.skip(str(error))


def options(machines: list[FarMachine], folder: Path) -> list[object]:
    named = [word for machine in machines for word in ("--machine", f"{machine.host}=1")]
    return ["--workers", 0, *named, "--machine-program", program_of(folder / "ssh")]


def test_a_machine_on_which_nothing_runs_is_one_sentence_and_the_way_out(
    start: Start, port: int, machines: list[FarMachine], tmp_path: Path
) -> None:
    host = machines[0].host
    wrong = ("--workers", 0, "--machine", host, "--machine-program", "/nowhere/arena")
    pit = start("serve", "--listen", f"tcp/127.0.0.1:{port}", "--data", tmp_path, *wrong)
    assert pit.finish() == 2, pit.said
    way_out = f"`ssh {host} /nowhere/arena --version` must answer, and ask for no password"
    assert pit.said.endswith(f"arena: {host} runs no worker, 4 times in a row; {way_out}\n")


class HeldMatch:
    """A match on other machines that waits at its eighth tick for a bot, which thinks until it is let go."""

    def __init__(self, serve: Start, join: Start, machines: list[FarMachine], folder: Path) -> None:
        bot = write_bot(folder, stop_at=8)
        self.pit = serve("--matches", 1, "--turn-time", 60, *options(machines, folder))
        self._red = join("--team", "red", "--policy", "patrol")
        self._blue = join("--team", "blue", "--policy", bot).wait_for("thinking at 8")
        (self.path,) = (folder / "journals").glob("*.journal")
        self.begun = self.path.read_bytes()
        self._folder = folder

    def end_well(self) -> None:
        """Let it go on; it ends with every tick asked for once, in its turn, and none charged to anybody."""
        (self._folder / "go").touch()
        self.pit.wait_for("after ")
        self.pit.send(signal.SIGTERM)
        assert [process.finish() for process in (self._red, self._blue, self.pit)] == [0, 0, 0], self.pit.said
        (journal,) = journals(self._folder)
        assert self.path.read_bytes().startswith(self.begun)
        assert asked(self._folder, self._blue) == list(range(len(journal.ticks)))
        assert not any(mark for tick in journal.ticks for mark in tick.marks)


def test_other_machines_write_the_same_journals_as_this_one(
    start: Start, port: int, machines: list[FarMachine], tmp_path: Path
) -> None:
    here = play_four(start, port, tmp_path / "here")
    assert_the_same(here, play_four(start, port, tmp_path / "there", *options(machines, tmp_path), "--fsync"))
    wait_until(lambda: not any(machine.workers() for machine in machines))


def test_a_match_goes_on_at_its_tick_when_its_worker_or_its_machine_dies(
    serve: Start, join: Start, machines: list[FarMachine], tmp_path: Path
) -> None:
    match = HeldMatch(serve, join, machines, tmp_path)
    pit = match.pit
    for machine in machines:
        for pid in machine.workers():
            os.kill(pid, signal.SIGKILL)
    for number in (1, 2):
        pit.wait_for(f"worker {number} was replaced")
    assert "is not reached" not in pit.said
    assert match.path.read_bytes() == match.begun

    one, other = machines
    one.die()
    pit.wait_for(f"{one.host} is not reached").wait_for(f"it is started on {other.host}")
    wait_until(lambda: len(other.workers()) == 2)
    one.start()
    pit.wait_for(f"worker 1 returns to {one.host}")
    wait_until(lambda: len(one.workers()) == len(other.workers()) == 1)
    other.die()
    wait_until(lambda: len(one.workers()) == 2)
    match.end_well()


@pytest.mark.parametrize("how", [(), ("delay", "20ms", "5ms", "loss", "2%")], ids=["good", "netem"])
def test_nothing_is_lost_when_networks_are_cut(
    serve: Start, join: Start, networked: list[tuple[FarMachine, Network]], tmp_path: Path, how: tuple[str, ...]
) -> None:
    (one, of_one), (other, of_other) = networked
    for link in (of_one, of_other):
        if how:
            with lacking_is_told():
                link.disturb(*how)
    match = HeldMatch(serve, join, [one, other], tmp_path)
    pit = match.pit

    of_one.cut()
    pit.wait_for(f"{one.host} is not reached").wait_for("worker 1 was replaced")
    of_one.mend()
    of_other.cut()
    pit.wait_for(f"{other.host} is not reached").wait_for("worker 2 was replaced")
    of_other.mend()
    match.end_well()
