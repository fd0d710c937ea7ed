"""Real processes: the command line as users run it, listened to line by line."""

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 60.0
"""Several test processes share few cores; what is well ends long before."""


class Command:
    """A process, and what it has said so far."""

    def __init__(self, code: str, arguments: tuple[object, ...]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        self._lines: list[str] = []
        self._changed = threading.Condition()
        self._is_silent = False
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
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
        if self.process.stdout is not None:
            self.process.stdout.close()


@pytest.fixture
def port() -> int:
    """Return a port that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def start() -> Iterator[Callable[..., Command]]:
    """Start `arena` with some arguments, or with `code=` any Python; whatever still runs is ended with the test."""
    with ExitStack() as running:

        def begin(*arguments: object, code: str = "from arena.cli import main; main()") -> Command:
            command = Command(code, arguments)
            running.callback(command.close)
            return command

        yield begin


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
