"""A worker away from its own machine returns to it: only when another is there to take its place, and nobody is blamed."""

import pickle
import sys
import time
from collections.abc import Iterator
from ctypes import c_longlong
from errno import EMFILE, ENOMEM
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import pytest
from offline_pit import PIT, RULES

from arena.match.time_control import TimeControl
from arena.pit.events import WorkerLost, WorkerReady
from arena.pit.workers import lost_machines
from arena.pit.workers.machines import HERE, Machine
from arena.pit.workers.messages import Room, WorkerSettings
from arena.pit.workers.processes import WorkerProcesses
from arena.pit.workers.worker import describe_version

_SSH = """
import os, pathlib, sys
sys.exit(255) if pathlib.Path({down!r}).exists() else os.execv("/bin/sh", ["sh", "-c", sys.argv[-1]])
"""
_FAR = """
import pathlib
from multiprocessing.connection import Connection
pit, says = Connection(0, writable=False), Connection(1, readable=False)
says.send_bytes(pathlib.Path({version!r}).read_bytes())
try:
    pit.recv_bytes()
    says.send_bytes({room!r})
    pit.recv_bytes()
except EOFError:
    pass
"""
_PATIENCE_S = 60.0


def work(pipe: Connection, mark: c_longlong) -> None:
    """Be ready, and wait for the end."""
    pipe.send_bytes(describe_version())
    pipe.recv()
    pipe.send(Room(0, 1))
    pipe.recv()


def program(path: Path, text: str) -> Path:
    path.with_suffix(".py").write_text(text)
    path.write_text(f'#!/bin/sh\nexec {sys.executable} {path.with_suffix(".py")} "$@"\n')
    path.chmod(0o700)
    return path


class Workers:
    """Two workers, of which the second has a machine of its own."""

    def __init__(self, folder: Path) -> None:
        self.down, self.version = folder / "down", folder / "version"
        self.version.write_bytes(describe_version())
        self.ssh = program(folder / "ssh", _SSH.format(down=str(self.down)))
        far = program(folder / "far", _FAR.format(version=str(self.version), room=pickle.dumps(Room(0, 1))))
        settings = [
            WorkerSettings(
                number=number, endpoint="", pit="pit", private=PIT.private.private_bytes_raw(), spectator_key=None,
                public_delay=0, ruleset=RULES, time_control=TimeControl(), journals=folder, fsync=False,
            )
            for number in (1, 2)
        ]  # fmt: skip
        self._heard: SimpleQueue[Any] = SimpleQueue()
        self.processes = WorkerProcesses(settings, self._heard.put, work, [HERE, Machine("far", str(far))])

    def start_without_far(self) -> None:
        """Start them while the other machine does not answer; both are ready here then."""
        self.down.touch()
        self.processes.start()
        assert {self.next(), self.next()} == {WorkerReady(1), WorkerReady(2)}

    def look(self) -> Any:
        """Look after them once; return whether one is ready or lost, as far as one is."""
        self.processes.look()
        try:
            event = self._heard.get(timeout=0.01)()
        except Empty:
            return None
        return event if isinstance(event, WorkerReady | WorkerLost) else None

    def next(self) -> Any:
        """Look after them until one is ready or lost, and return that."""
        end_s = time.monotonic() + _PATIENCE_S
        while (event := self.look()) is None:
            assert time.monotonic() < end_s, "nothing happens"
        return event


@pytest.fixture
def workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workers]:
    made = Workers(tmp_path)
    monkeypatch.setenv("ARENA_SSH", str(made.ssh))
    monkeypatch.setattr(lost_machines, "_REST_S", 0.0)
    yield made
    made.processes.close()


def test_a_worker_returns_to_its_machine_once_that_answers_and_no_match_is_blamed(
    workers: Workers, caplog: pytest.LogCaptureFixture
) -> None:
    workers.start_without_far()
    assert "worker 2 goes on: it is started on this machine for far" in caplog.messages

    workers.down.unlink()

    assert workers.next() == WorkerLost(2, is_cut_off=True)
    assert workers.next() == WorkerReady(2)
    assert [said for said in caplog.messages if "returns" in said] == ["worker 2 returns to far"]
    assert caplog.messages.count("far is not reached") == 1


def test_a_worker_does_not_return_to_a_machine_on_which_none_could_take_its_place(
    workers: Workers, caplog: pytest.LogCaptureFixture
) -> None:
    workers.start_without_far()

    workers.version.write_bytes(b'{"arena": "0"}')
    workers.down.unlink()
    end_s = time.monotonic() + _PATIENCE_S
    while not any("another version" in said for said in caplog.messages):
        assert time.monotonic() < end_s
        assert workers.look() is None
    workers.version.write_bytes(describe_version())

    assert workers.next() == WorkerLost(2, is_cut_off=True)
    assert caplog.messages.index("worker 2 returns to far") > caplog.messages.index("far answers again")
    assert workers.next() == WorkerReady(2)


def test_a_worker_that_cannot_be_started_for_now_is_started_a_moment_later(
    workers: Workers, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    workers.start_without_far()
    context = workers.processes._context
    make_pipe, failures = context.Pipe, [OSError(ENOMEM, "Cannot allocate memory"), OSError(EMFILE, "Too many open files")]

    def fail_at_first() -> Any:
        if failures:
            raise failures.pop()
        return make_pipe()

    monkeypatch.setattr(context, "Pipe", fail_at_first)
    workers.processes._places[1].process.kill()

    assert [workers.next(), workers.next()] == [WorkerLost(1), WorkerReady(1)]
    said = [one for one in caplog.messages if "worker 1 cannot be started for now" in one]
    assert [one.partition(": ")[2] for one in said] == ["Too many open files", "Cannot allocate memory"]
