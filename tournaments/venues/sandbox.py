"""Start a stranger's fighter under limits, in a home of its own, in a session that ends with all its children when we do.

The limits are the kernel's (setrlimit), so that they hold for every process that the fighter starts, each by itself. They are
no wall: whoever runs strangers' code under a user that matters reads `docs/security.md` first.
"""

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import IO

from tournaments.league.limits import Limits

_MIB = 1 << 20
_WATCH = "exec 3<&0; { read line <&3; kill -s KILL 0; } &"
"""Waits until the pipe on its stdin closes, as it does when whoever holds the other end is killed; then ends its session."""


class SandboxedProcess:
    """A running command, its output appended to a log. Our compiled kernels are shared with it, which saves it half a minute."""

    def __init__(self, command: Sequence[str], limits: Limits, home: Path, log: IO[bytes]) -> None:
        from arena.folders import data_folder
        from arena.jit import cache_root  # not in the new process, which is to become another at once

        home = home.absolute()  # it starts there, where no relative path is right
        data_folder(home, 0o700)
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "ARENA_CONFIG"))}
        # `-P` keeps the current folder out of the import path: a bot's neighbours must not pose as our modules.
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "tournaments.venues.sandbox", json.dumps(asdict(limits)), *command],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            cwd=home,
            env={**environment, "HOME": str(home), "NUMBA_CACHE_DIR": str(cache_root())},
            start_new_session=True,
        )

    def end(self, patience_s: float) -> None:
        """Ask it to end, and end it and all that it started if it does not."""
        with suppress(ProcessLookupError):
            self.process.terminate()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(patience_s)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()


def main() -> None:
    """Leave a watch behind, set limits and become the command; in the new process."""
    _leave_watch()
    limits = Limits(**json.loads(sys.argv[1]))
    for kind, value in (
        (resource.RLIMIT_AS, limits.memory_mb and limits.memory_mb * _MIB),
        (resource.RLIMIT_CPU, limits.cpu_s),
        (resource.RLIMIT_NPROC, limits.processes),
    ):
        if value:
            resource.setrlimit(kind, (value, value))
    os.execv(sys.argv[2], sys.argv[2:])


def _leave_watch() -> None:
    """Start a shell, a megabyte small, that ends this session with who began it; no child of the command that we become."""
    subprocess.run(["/bin/sh", "-c", _WATCH], check=True)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


if __name__ == "__main__":
    main()
