"""A process that has imported what takes long, and forks itself for each command that a test starts; `nursery.py` asks it.

Nothing of the arena is imported here: its modules, and its caches on the disk, each child meets anew.
"""

import os
import select
import signal
import socket
import sys
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle

# What `arena serve`, `join`, `web`, `leaderboard` and `replay` take from others.
MODULES = (
    "alembic.command", "cryptography.hazmat.primitives.asymmetric.ed25519", "cryptography.hazmat.primitives.ciphers.aead",
    "cryptography.x509", "jinja2", "logging.config", "msgpack", "numpy.random", "openskill.models", "PIL.Image", "platformdirs",
    "prometheus_client", "pydantic", "rich.live", "rich.progress", "rich.table", "scipy.linalg", "scipy.special",
    "sqlalchemy.dialects.sqlite", "starlette.applications", "starlette.routing", "starlette.websockets", "typer.testing",
    "uvicorn", "websockets", "zenoh",
)  # fmt: skip


def warm() -> None:
    """Import other people's modules, and have numba load what it compiles and runs with."""
    import numba
    import numpy as np

    for name in MODULES:
        import_module(name)
    numba.njit(lambda numbers: numbers.sum())(np.zeros(1, np.int8))


def bear(asker: Connection) -> str:
    """Fork whenever somebody asks, and tell how each child ended; return, in a child, the code that it is to run."""
    woken, wakes = socket.socketpair()
    wakes.setblocking(False)
    signal.set_wakeup_fd(wakes.fileno())
    signal.signal(signal.SIGCHLD, lambda *_: None)
    reports: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([asker.fileno(), woken.fileno()], [], [])
        if woken.fileno() in ready:
            woken.recv(4096)
            for pid in list(reports):
                ended, status = os.waitpid(pid, os.WNOHANG)
                if ended:
                    with suppress(BrokenPipeError):  # whoever asked no longer wants to know
                        os.write(reports[pid], str(os.waitstatus_to_exitcode(status)).encode())
                    os.close(reports.pop(pid))
        if asker.fileno() in ready:
            try:
                code, arguments, environment, folder = asker.recv()
                out, err, report = (recv_handle(asker) for _ in range(3))
            except EOFError:
                sys.exit()
            pid = os.fork()
            if pid == 0:
                break
            reports[pid] = report
            os.close(out)
            os.close(err)
            asker.send(pid)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.set_wakeup_fd(-1)
    os.dup2(out, 1)
    os.dup2(err, 2)
    for held in (out, err, report, *reports.values()):
        os.close(held)
    for end in (asker, woken, wakes):
        end.close()
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = ["-c", *arguments]
    return str(code)


if __name__ == "__main__":
    warm()
    exec(bear(Connection(int(sys.argv[1]))), {"__name__": "__main__"})
