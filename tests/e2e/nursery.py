"""Processes that start in a quarter of the time: real ones, each with a pid, signals, pipes and an exit code of its own.

A new interpreter spends a second of a core on numba, scipy and others before it reaches the arena, and hundreds are started
here. So one process, `mother.py`, imports them once and is forked. That an interpreter of its own does the same is left to the
tests that start one: most of those outside this folder, and `code=` here.
"""

import os
import select
import subprocess
import sys
import threading
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.reduction import send_handle
from pathlib import Path
from signal import SIGKILL

CAN_FORK = sys.platform == "linux"
"""Elsewhere a process with threads had better not be forked, and each command has an interpreter of its own."""
MOTHER = Path(__file__).with_name("mother.py")


class Born:
    """A process of a nursery, as `subprocess.Popen` shows its own."""

    def __init__(self, pid: int, report: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._report = report

    def poll(self) -> int | None:
        with suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            if not select.select([self._report], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0)
            said = os.read(self._report, 16)
            os.close(self._report)
            assert said, "the nursery has ended before its process"
            self.returncode = int(said)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(SIGKILL)


class Nursery:
    """Starts Python as `python -c CODE ARGUMENTS` would, in this environment and folder."""

    def __init__(self) -> None:
        if not CAN_FORK:
            return
        self._lock = threading.Lock()
        self._asks, answers = Pipe()
        with answers:
            self._mother = subprocess.Popen(
                [sys.executable, "-c", MOTHER.read_text(), str(answers.fileno())],
                pass_fds=[answers.fileno()],
                stdin=subprocess.DEVNULL,
                env=environment(),
            )

    def start(self, code: str, arguments: tuple[str, ...], out: int, err: int) -> Born | subprocess.Popen[bytes]:
        """Start a process that writes to two files, which stay open here."""
        if not CAN_FORK:
            command = [sys.executable, "-c", code, *arguments]
            return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=environment())
        reads, writes = os.pipe()
        with self._lock:
            self._asks.send((code, arguments, environment(), str(Path.cwd())))
            for handle in (out, err, writes):
                send_handle(self._asks, handle, self._mother.pid)
            pid = self._asks.recv()
        os.close(writes)
        return Born(pid, reads)

    def close(self) -> None:
        if CAN_FORK:
            self._asks.close()
            self._mother.wait()


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONUNBUFFERED": "1"}
