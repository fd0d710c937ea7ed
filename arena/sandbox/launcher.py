"""Set limits and become a command; run by its path in the new process, so it imports the standard library alone.

It stands behind the wall already, if there is one, so that a limit on processes counts those behind the wall.
"""

import ctypes
import json
import os
import resource
import signal
import sys

_MIB = 1 << 20
_PR_SET_PDEATHSIG = 1


def main() -> None:
    """Take limits as JSON, and the command."""
    limits = json.loads(sys.argv[1])
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # it ends with the thread that started it
    for kind, value in (
        (resource.RLIMIT_AS, limits["memory_mb"] and limits["memory_mb"] * _MIB),
        (resource.RLIMIT_CPU, limits["cpu_s"]),
        (resource.RLIMIT_NPROC, limits["processes"]),
        (resource.RLIMIT_NOFILE, limits["files"]),
        (resource.RLIMIT_FSIZE, limits["disk_mb"] and limits["disk_mb"] * _MIB),
        (resource.RLIMIT_CORE, 0),
    ):
        if value is not None:
            _, most = resource.getrlimit(kind)
            soft = value if most == resource.RLIM_INFINITY else min(value, most)
            # A process is told of its processor time by a signal, which it may ignore for a second.
            hard = soft + 1 if kind == resource.RLIMIT_CPU and (most == resource.RLIM_INFINITY or soft < most) else soft
            resource.setrlimit(kind, (soft, hard))
    os.execvp(sys.argv[2], sys.argv[2:])


if __name__ == "__main__":
    main()
