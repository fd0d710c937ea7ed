"""Real processes: the command line as users run it, listened to line by line."""

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import pytest
from nursery import Born, Nursery, environment
from typer.testing import CliRunner

from tournaments.cli import app

ARENA = "from tournaments.cli import main; main()"
PATIENCE_S = 60.0
"""Several test processes share few cores; what is well ends long before."""


class Command:
    """A process, and what it has said so far."""

    def __init__(self, code: str, arguments: tuple[object, ...], nursery: Nursery | None = None) -> None:
        """Start Python, as an interpreter of its own where no nursery is given."""
        reads, writes = os.pipe()
        self._said = open(reads)  # noqa: PTH123, SIM115  # a pipe, which close() closes
        words = tuple(map(str, arguments))
        self.process: Born | subprocess.Popen[bytes]
        if nursery is not None:
            self.process = nursery.start(code, words, writes, writes)
        else:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code, *words],
                stdout=writes,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env=environment(),
            )
        os.close(writes)
        self._lines: list[str] = []
        self._changed = threading.Condition()
        self._is_silent = False
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        for line in self._said:
            with self._changed:
                self._lines.append(line)
                self._changed.notify_all()
        with self._changed:
            self._is_silent = True
            self._changed.notify_all()

    @property
    def said(self) -> str:
        with self._changed:
            return "".join(self._lines)

    def wait_for(self, text: str) -> "Command":
        """Wait until the process has said something."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_silent or any(text in line for line in self._lines), PATIENCE_S)
        assert text in self.said, f"{text!r} is missing in:\n{self.said}"
        return self

    def finish(self) -> int:
        """Wait for the end of the process, and return its exit code."""
        try:
            code = self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"it does not end; it said:\n{self.said}") from None
        self._reader.join(PATIENCE_S)
        return code

    def send(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def kill(self) -> None:
        self.process.kill()
        self.finish()

    def close(self) -> None:
        with suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait()
        self._reader.join(PATIENCE_S)
        self._said.close()


def run_here(*arguments: object) -> None:
    """Run a command that must go well in this process and on one core: what a test needs, and is not about."""
    handler = signal.getsignal(signal.SIGTERM)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda _: {0})
        done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    signal.signal(signal.SIGTERM, handler)
    assert done.exit_code == 0, done.output


@pytest.fixture
def port() -> int:
    """Return a port that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def starting(nursery: Nursery | None) -> Iterator[Callable[..., Command]]:
    """Start `arena` with some arguments, or with `code=` any Python in an interpreter of its own; end what still runs."""
    with ExitStack() as running:

        def begin(*arguments: object, code: str = "") -> Command:
            command = Command(code, arguments) if code else Command(ARENA, arguments, nursery)
            running.callback(command.close)
            return command

        yield begin


@pytest.fixture
def start() -> Iterator[Callable[..., Command]]:
    """Start `arena` in interpreters of their own."""
    with starting(None) as begin:
        yield begin


@pytest.fixture(scope="session")
def nursery() -> Iterator[Nursery]:
    """Keep one process from which others are quickly started."""
    kept = Nursery()
    yield kept
    kept.close()


@pytest.fixture
def quick_start(nursery: Nursery) -> Iterator[Callable[..., Command]]:
    """Start `arena` from the nursery."""
    with starting(nursery) as begin:
        yield begin


@pytest.fixture(scope="module")
def shared_start(nursery: Nursery, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Command]]:
    """Start what the tests of a module share, away from the user's keys."""
    with pytest.MonkeyPatch.context() as patch, starting(nursery) as begin:
        patch.setenv("ARENA_CONFIG", str(tmp_path_factory.mktemp("config")))
        yield begin


@pytest.fixture(scope="session")
def quick_arena(nursery: Nursery) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the command line from the nursery: `arena("rules", "paper")`."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        words = tuple(map(str, arguments))
        with TemporaryFile() as out, TemporaryFile() as err:
            process = nursery.start(ARENA, words, out.fileno(), err.fileno())
            try:
                code = process.wait(300)
            finally:
                process.kill()
            out.seek(0)
            err.seek(0)
            return subprocess.CompletedProcess(words, code, out.read().decode(), err.read().decode())

    return run


@pytest.fixture
def serve(start: Callable[..., Command], port: int, tmp_path: Path) -> Callable[..., Command]:
    """Open a pit at `port`, with its data in `tmp_path`, and wait until it is open. Its maps are always the same."""
    pit = ("serve", "--listen", f"tcp/127.0.0.1:{port}", "--data", tmp_path, "--seed", 7)

    def begin(*arguments: object, **options: Any) -> Command:
        return start(*pit, *arguments, **options).wait_for("join with: ")

    return begin


@pytest.fixture
def join(start: Callable[..., Command], port: int) -> Callable[..., Command]:
    """Start a client of that pit."""

    def begin(*arguments: object, **options: Any) -> Command:
        return start("join", f"arena://127.0.0.1:{port}/pit", *arguments, **options)

    return begin
