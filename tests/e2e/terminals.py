"""The command line on a real terminal: what it draws, and keys for it."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

PATIENCE_S = 60.0
ARENA = [sys.executable, "-c", "from tournaments.cli import main; main()"]


class Terminal:
    """A command on a terminal of 80 columns and 24 rows."""

    def __init__(self, *arguments: object) -> None:
        self._end, end = pty.openpty()
        self.resize(24, 80)
        environment = {**os.environ, "TERM": "xterm-256color"}
        self.process = subprocess.Popen(
            [*ARENA, *map(str, arguments)], stdin=end, stdout=end, stderr=end, env=environment, start_new_session=True
        )
        os.close(end)
        self.said = ""

    def read(self) -> bool:
        """Wait for the next piece of what it writes; False at its end."""
        assert select.select([self._end], [], [], PATIENCE_S)[0], f"it says nothing more after:\n{self.said[-2000:]}"
        with suppress(OSError):  # what Linux says when the last writer has gone
            piece = os.read(self._end, 1 << 16)
            self.said += piece.decode(errors="replace")
            return bool(piece)
        return False

    def wait_for(self, text: str) -> None:
        while text not in self.said:
            assert self.read(), f"{text!r} is missing in:\n{self.said[-2000:]}"

    def press(self, keys: str) -> None:
        os.write(self._end, keys.encode())

    def resize(self, rows: int, columns: int) -> None:
        fcntl.ioctl(self._end, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    @property
    def mode(self) -> list[Any]:
        """What `termios` says of it."""
        return termios.tcgetattr(self._end)

    def read_to_the_end(self) -> int:
        """Wait until the command has ended; return its exit code."""
        while self.read():
            pass
        return self.process.wait(PATIENCE_S)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._end)


@pytest.fixture
def terminal() -> Iterator[Callable[..., Terminal]]:
    opened: list[Terminal] = []

    def begin(*arguments: object) -> Terminal:
        opened.append(Terminal(*arguments))
        return opened[-1]

    yield begin
    for one in opened:
        one.close()
