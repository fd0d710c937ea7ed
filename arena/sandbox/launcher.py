"""Become a command, under limits; run by its path in the new process, so it imports the standard library alone.

It is run before a wall, to enter control groups and to end with its parent, and behind it, so that a limit on processes counts
those behind the wall. Where there is no wall, once is enough.
"""

import ctypes
import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any

_MIB = 1 << 20
_PR_SET_PDEATHSIG = 1
_FIRST_TO_GO = "1000"
_KEYCTL = {"x86_64": 250, "aarch64": 219, "riscv64": 219}
_JOIN_SESSION_KEYRING = 1


def main() -> None:
    """Take what to do as JSON, and the command."""
    order: dict[str, Any] = json.loads(sys.argv[1])
    if "parent" in order:
        follow(order["parent"])
        forget_keys()
    for group in order.get("groups", ()):
        Path(group).write_text(str(os.getpid()))
    if "limits" in order:
        _limit(order["limits"])
    os.execvp(sys.argv[2], sys.argv[2:])


def follow(parent: int) -> None:
    """End with the thread that started us, and at once if it has ended."""
    if sys.platform != "linux":
        return  # it ends once its stdin is closed
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        raise SystemExit(1)
    Path("/proc/self/oom_score_adj").write_text(_FIRST_TO_GO)  # before the referee, should the machine run out of memory


def forget_keys() -> None:
    """Leave the keyring of whoever started us, which no namespace hides: it may hold keys, or word for another bot."""
    number = _KEYCTL.get(os.uname().machine)
    if sys.platform == "linux" and number is not None:  # where it is refused, a bot is refused it, too
        ctypes.CDLL(None).syscall(number, _JOIN_SESSION_KEYRING, None)


def _limit(limits: dict[str, int | None]) -> None:
    memory_mb, disk_mb = limits["memory_mb"], limits["disk_mb"]
    for kind, value in (
        (resource.RLIMIT_AS, memory_mb and memory_mb * _MIB),
        (resource.RLIMIT_CPU, limits["cpu_s"]),
        (resource.RLIMIT_NPROC, limits["processes"]),
        (resource.RLIMIT_NOFILE, limits["files"]),
        (resource.RLIMIT_FSIZE, disk_mb and disk_mb * _MIB),
        (resource.RLIMIT_CORE, 0),
    ):
        if value is None:
            continue
        _, most = resource.getrlimit(kind)
        soft = value if most == resource.RLIM_INFINITY else min(value, most)
        # Of its processor time a process is told by a signal, and killed a second later if it does not listen.
        hard = soft + 1 if kind == resource.RLIMIT_CPU and (most == resource.RLIM_INFINITY or soft < most) else soft
        resource.setrlimit(kind, (soft, hard))


if __name__ == "__main__":
    main()
