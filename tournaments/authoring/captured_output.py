"""What bots and their programs print while somebody looks at a screen that their lines would spoil."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryFile
from typing import IO, TextIO

_MOST_BYTES = 1 << 14
"""That are kept of what is taken at once."""


class CapturedOutput:
    """What was written to stdout and stderr since, and the terminal that stdout was."""

    def __init__(self, kept: IO[bytes], terminal: TextIO) -> None:
        self.terminal = terminal
        self._kept = kept
        self._n_taken = 0

    def take(self) -> list[str]:
        """Return the lines that were written since the last call, not clean; of very many, the first and how much is left out."""
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        descriptor = self._kept.fileno()
        n_written = os.fstat(descriptor).st_size
        data = os.pread(descriptor, min(n_written - self._n_taken, _MOST_BYTES), self._n_taken)
        n_left_out = n_written - self._n_taken - len(data)
        self._n_taken = n_written
        lines = data.decode("utf-8", "replace").splitlines()
        return [*lines, f"({n_left_out:,} more bytes)"] if n_left_out else lines


@contextmanager
def captured_output() -> Iterator[CapturedOutput]:
    """Keep aside what anybody writes to stdout and stderr, by whatever means, this process's children included."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    former = {number: os.dup(number) for number in (1, 2)}
    with TemporaryFile() as kept, open(os.dup(1), "w", encoding="utf-8") as terminal:  # noqa: PTH123  # a descriptor
        for number in former:
            os.dup2(kept.fileno(), number)
        try:
            yield CapturedOutput(kept, terminal)
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            for number, before in former.items():
                os.dup2(before, number)
                os.close(before)
