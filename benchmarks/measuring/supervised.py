"""A process that is started again whenever it ends, as systemd does it; and what runs of all that it started."""

import os
import subprocess
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

RESTART_S = 2.0
"""How long after its end a process is started again, as in arena@.service."""
_MARK = "ARENA_SOAK"


class Supervised:
    """One process, and all that it starts, which end with the `with` block."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        folder: Path,
        environment: Mapping[str, str] | None = None,
        *,
        is_forever: bool = True,
    ) -> None:
        self.name, self._command, self._is_forever = name, command, is_forever
        self._mark = f"{folder}/{name}"
        self._log = folder / f"{name}.log"
        self._environment = {**os.environ, **(environment or {}), _MARK: self._mark}
        self._start_at_s = 0.0
        self.process: subprocess.Popen[bytes] | None = None
        self.n_starts = 0
        self.exits: Counter[int] = Counter()
        """How often it ended, by exit code; -9 if it was killed."""

    def __enter__(self) -> "Supervised":
        return self

    def __exit__(self, *_: object) -> None:
        for pid in self.family():
            _send(pid, 9)
        if self.process is not None:
            self.process.wait()

    @property
    def is_running(self) -> bool:
        """Whether it is there, as far as `tend` has seen."""
        return self.process is not None

    @property
    def has_finished(self) -> bool:
        """Whether it ended well, where it need not run for ever."""
        return not self._is_forever and self.exits[0] > 0 and self.process is None

    def tend(self) -> None:
        """Start it if it is not there, and note how it ended."""
        now_s = time.monotonic()
        if self.process is not None and (code := self.process.poll()) is not None:
            self.process = None
            self.exits[code] += 1
            self._start_at_s = now_s + RESTART_S
        if self.process is None and now_s >= self._start_at_s and not self.has_finished:
            self.start()

    def start(self) -> None:
        """Start it now; one that had finished, too."""
        self.exits.pop(0, None)
        self.n_starts += 1
        with self._log.open("ab") as log:
            self.process = subprocess.Popen(
                self._command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=self._environment
            )

    def find(self, words: str = "") -> list[int]:
        """Return the processes of its family whose command lines have these words; without any, itself."""
        if not words:
            return [] if self.process is None else [self.process.pid]
        return sorted(pid for pid, command in self.family().items() if words in command)

    def family(self) -> dict[int, str]:
        """Return the process ids of all that it started and of itself, and their command lines."""
        found, mark = {}, f"{_MARK}={self._mark}".encode()
        for folder in Path("/proc").iterdir():
            if folder.name.isdigit():
                with suppress(OSError):
                    if mark in (folder / "environ").read_bytes().split(b"\0"):
                        found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        return found

    def finish(self, patience_s: float) -> int | None:
        """Tell it to end, and return its exit code; None if it does not end in time."""
        if self.process is None:
            return None
        self.process.terminate()
        with suppress(subprocess.TimeoutExpired):
            return self.process.wait(patience_s)
        return None

    @property
    def last_words(self) -> str:
        """The last line that it said."""
        lines = self._log.read_text(errors="replace").strip().splitlines() if self._log.exists() else []
        return lines[-1] if lines else ""


def _send(pid: int, number: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)
