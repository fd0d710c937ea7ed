"""A process under limits, behind a wall or not, that ends with all that it started, at the latest when its parent does."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO, Any

from arena.errors import InputError
from arena.sandbox import launcher
from arena.sandbox.bubblewrap import wall_command, why_no_limits, why_no_wall
from arena.sandbox.control_group import ControlGroup
from arena.sandbox.limits import Limits

_OUT_OF_TIME = {128 + signal.SIGXCPU, -signal.SIGXCPU}
_KILLED = {128 + signal.SIGKILL, -signal.SIGKILL}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sandbox:
    """Where a stranger's process runs, and under which limits."""

    has_wall: bool
    limits: Limits
    readable: tuple[Path, ...] = ()
    """What it finds behind the wall beside Python and the arena's packages."""

    def check(self) -> None:
        """Raise `InputError`, one sentence with the way out, if this machine cannot hold what is promised."""
        why = (why_no_wall() or why_no_limits()) if self.has_wall else None
        if why is not None:
            raise InputError(f'no sandbox can be made: {why}; or go without it, by --no-sandbox, or sandbox = "none" in a league')


class SandboxedProcess:
    """A running command.

    It is killed when the thread that started it ends, as the kernel counts parents: start it from one that lasts.

    Parameters
    ----------
    environment
        The whole of it; behind a wall, PATH, HOME and the language are set beside it.
    cwd
        Where it starts; behind a wall, that is its home.
    log
        Takes what it writes to stdout and stderr. Without it, there are pipes for both, and for stdin.
    """

    def __init__(
        self,
        command: Sequence[str],
        sandbox: Sandbox,
        environment: Mapping[str, str],
        *,
        cwd: Path | None = None,
        log: IO[bytes] | None = None,
    ) -> None:
        self._limits = sandbox.limits
        self._group = ControlGroup.make(sandbox.limits)
        try:
            self.process = self._start(command, sandbox, environment, cwd, log)
        except BaseException:
            if self._group is not None:
                self._group.remove()
            raise
        self._met: list[str] = []

    def _start(
        self, command: Sequence[str], sandbox: Sandbox, environment: Mapping[str, str], cwd: Path | None, log: IO[bytes] | None
    ) -> subprocess.Popen[bytes]:
        limits = sandbox.limits
        if self._group is None and sandbox.has_wall and (why := why_no_limits()) is not None:
            raise InputError(f"the limits of a sandbox cannot be held any more: {why}")
        if self._group is not None:  # it counts memory better than the address space does
            limits = replace(limits, memory_mb=None)
        outside: dict[str, Any] = {"parent": os.getpid(), "groups": [] if self._group is None else self._group.entrances}
        if sandbox.has_wall:
            behind = _launch({"limits": asdict(limits)}, command)
            behind = wall_command(behind, readable=sandbox.readable, environment=environment, limits=sandbox.limits)
            launched = _launch(outside, behind)
        else:
            launched = _launch({**outside, "limits": asdict(replace(limits, disk_mb=None))}, command)
        return subprocess.Popen(
            launched,
            stdin=subprocess.PIPE if log is None else subprocess.DEVNULL,
            stdout=subprocess.PIPE if log is None else log,
            stderr=subprocess.PIPE if log is None else log,
            env={} if sandbox.has_wall else environment,  # what bubblewrap has, its first process shows in /proc
            cwd=None if sandbox.has_wall else cwd,
            start_new_session=True,
            bufsize=0,
        )

    @property
    def pipes(self) -> tuple[IO[bytes], IO[bytes], IO[bytes]]:
        """Its stdin, stdout and stderr, where there is no log."""
        stdin, stdout, stderr = self.process.stdin, self.process.stdout, self.process.stderr
        if stdin is None or stdout is None or stderr is None:
            raise ValueError("the process writes to a log")
        return stdin, stdout, stderr

    @property
    def is_running(self) -> bool:
        """Whether it has not ended."""
        return self.process.poll() is None

    def terminate(self) -> None:
        """Ask it to end."""
        self.process.terminate()

    def memory_bytes(self) -> int | None:
        """Return what it and all that it started hold in memory; None where the system does not tell."""
        return _resident_bytes(self.process.pid)

    def send_signal(self, number: int) -> None:
        """Send a signal to the command itself, behind its wall or not; nothing is done if it has ended."""
        pid = self.process.pid
        with suppress(OSError, ValueError, IndexError):
            while Path(f"/proc/{pid}/comm").read_text() == "bwrap\n":
                pid = int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])
            os.kill(pid, number)

    def end(self, patience_s: float = 0.0) -> int:
        """End it and all that it started, unless it does so by itself soon; close the pipes, and return its exit code."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(patience_s)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)  # behind a wall: its monitor, with which the whole namespace goes
        code = self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout, self.process.stderr):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        if self._group is not None:
            self._met = self._group.limits_met()
            self._group.kill()
            self._group.remove()
            self._group = None
        return code

    def limits_met_so_far(self) -> list[str]:
        """Return which limits the running process has met, as far as it does not end by that; by the names of `Limits`."""
        return [] if self._group is None else self._group.limits_met()

    def limits_met(self, code: int, *, has_ended_itself: bool) -> list[str]:
        """Return which limits a process met that has ended, by the names of `Limits`.

        Parameters
        ----------
        code
            Its exit code.
        has_ended_itself
            Whether it ended before `end` was called.
        """
        met = list(self._met)
        is_killed = has_ended_itself and code in _KILLED and self._limits.cpu_s is not None and not met
        if code in _OUT_OF_TIME or is_killed:
            met.append("cpu_s")
        return met


def _launch(order: dict[str, Any], command: Sequence[str]) -> list[str]:
    return [sys.executable, "-I", "-S", launcher.__file__, json.dumps(order), *command]


def _resident_bytes(root: int) -> int | None:
    """Return the resident memory of a process and all its descendants."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
    if root not in parents:
        return None
    family, n_before = {root}, 0
    while len(family) > n_before:
        n_before = len(family)
        family |= {pid for pid, parent in parents.items() if parent in family}
    n_pages = 0
    for pid in family:
        with suppress(OSError):
            n_pages += int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return n_pages * os.sysconf("SC_PAGE_SIZE")
