"""A league or a season that is run in a process whose whole family is known: to be killed, and to be seen gone."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Self

PATIENCE_S = 100.0
"""Several test processes share few cores; what is well ends long before."""
_MARK = "ARENA_TEST_FAMILY"


class ArenaProcess:
    """An `arena` command with a data folder, and all that it starts; gone when `with` is left."""

    def __init__(self, data: Path, *words: str) -> None:
        self.data = data
        self._command = [sys.executable, "-c", "from tournaments.cli import main; main()", *words, "--data", str(data)]
        data.mkdir(exist_ok=True)
        self.process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    def start(self) -> None:
        """Start it, in a process group of its own."""
        with (self.data / "said").open("ab") as said:
            self.process = subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                env={**os.environ, _MARK: str(self.data)},
                start_new_session=True,
            )

    def ends_within(self, seconds: float) -> bool:
        """Wait for its end, but not for long."""
        assert self.process is not None
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(seconds)
        return self.process.returncode is not None

    def finish(self) -> int:
        """Wait for its end, and return its exit code."""
        assert self.ends_within(PATIENCE_S), self.said
        assert self.process is not None
        return self.process.returncode

    def kill(self) -> None:
        """Kill its process group, and wait until nobody of its family is left."""
        if self.process is None:
            return
        family = self.family()
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(PATIENCE_S)
        wait_for_the_end_of({*family, *self.family()})

    @property
    def said(self) -> str:
        """What it said so far, however often it was started."""
        return (self.data / "said").read_text(errors="replace")

    def family(self) -> dict[int, str]:
        """Return the process ids of all that it started, and their command lines."""
        found = {}
        for folder in Path("/proc").iterdir():
            if folder.name.isdigit():
                with suppress(OSError):
                    if f"{_MARK}={self.data}".encode() in (folder / "environ").read_bytes().split(b"\0"):
                        found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        return found

    def find(self, words: str) -> int | None:
        """Return the process of its family whose command line has these words, if it is there."""
        return next((pid for pid, command in self.family().items() if words in command), None)

    def find_referee(self) -> int | None:
        """Return its referee's process; in the network venue, nothing else is started that way."""
        return self.find("spawn_main")


class LeagueProcess(ArenaProcess):
    """`arena tournament run`."""

    def __init__(self, file: Path, venue: str, data: Path, db: str) -> None:
        self.db, self.journals, self.report = db, data / "journals" / file.stem, data / "report.json"
        words = ("tournament", "run", str(file), "--venue", venue, "--db", db, "--json", "--out", str(self.report))
        super().__init__(data, *words)


def processes() -> Iterator[tuple[int, str]]:
    """Yield the process id and the command line of all that runs, behind walls too."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with suppress(FileNotFoundError, ProcessLookupError):
                yield int(folder.name), (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()


def marked(mark: str) -> set[int]:
    """Return the processes that have a word in their command line."""
    return {pid for pid, command in processes() if mark in command}


def wait_for_the_end_of(pids: Iterable[int]) -> None:
    """Wait until processes have ended, whoever is to reap them."""
    give_up_at = time.monotonic() + PATIENCE_S
    for pid in pids:
        with suppress(ProcessLookupError):
            descriptor = os.pidfd_open(pid)
            try:
                waiting = select.poll()
                waiting.register(descriptor, select.POLLIN)
                assert waiting.poll(max(give_up_at - time.monotonic(), 0.0) * 1_000), f"process {pid} lives on"
            finally:
                os.close(descriptor)


def kill(pid: int) -> None:
    """Kill a process, and wait until it has ended."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
    wait_for_the_end_of([pid])
