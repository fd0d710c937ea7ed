"""Clients of our own fighters as forks of one process: it has imported and loaded what would take each client a second.

That process has one thread, no session and no key, and runs no stranger's code. It is asked over a socket, its stdin. The kernel
ends it with the thread that started it, and its forks with it.
"""

import ctypes
import gc
import json
import os
import resource
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from multiprocessing.connection import wait
from pathlib import Path
from typing import IO

from arena.compiling import find_missing
from arena.errors import ArenaError
from arena.folders import data_folder
from arena.sandbox.launcher import follow, forget_keys
from policies.precompile import fighter_kernels
from tournaments.venues.processes import RUN_ARENA, RestartLimit, client_environment
from tournaments.venues.setting import VenueSetting

_LOG = "pit.clients.log"  # no label of an entry ends in that
_PLACE_BYTES = 4_000
"""For what a fork is shown as."""
_SERVER = f"from tournaments.venues.fork_server import serve; serve(); {RUN_ARENA}"
_MODULES = (
    "arena.metrics.server",
    "clients.feedback",
    "clients.monitor",
    "clients.runner",
    "clients.versions",
    "policies.workers.policy",
    "tournaments.cli",
)
"""What `arena join` imports, in the end."""
_FIRST = "random"
"""Loads what all fighters share."""
_MOST_BYTES = 65_536
"""Of an order."""
_PATIENCE_S = 60.0
"""For the answer to an order; a server that has just been started imports first."""


@cache
def can_fork() -> bool:
    """Return whether forks can be made and seen here: elsewhere than on Linux, much must not be used after a fork."""
    if sys.platform != "linux":
        return False
    try:
        os.close(os.pidfd_open(os.getpid()))
    except OSError:
        return False
    return True


class ForkedProcess:
    """A fork of the server; its handle is of this process alone, whoever has its number later."""

    def __init__(self, pid: int, handle: int) -> None:
        self.pid, self._handle = pid, handle

    @property
    def is_running(self) -> bool:
        """Whether it has not ended."""
        return not wait([self._handle], 0)

    def terminate(self) -> None:
        """Ask it to end."""
        self._send(signal.SIGTERM)

    def end(self, patience_s: float = 0.0) -> None:
        """End it, unless it does so by itself soon. Our own fighters start no processes that would be left."""
        if not wait([self._handle], patience_s):
            self._send(signal.SIGKILL)
            wait([self._handle])
        os.close(self._handle)

    def _send(self, number: int) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._handle, number)


class ForkServer:
    """The process that is forked, as whoever starts clients sees it; it is started anew where it died.

    To be used by `with`, from one thread that lasts: all forks end with it.
    """

    def __init__(self, setting: VenueSetting) -> None:
        self._homes, self._log = setting.homes, setting.journals / _LOG
        self._restarts = RestartLimit("the process that clients are forked from", self._log)
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None

    def __enter__(self) -> "ForkServer":
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def begin(self) -> socket.socket:
        """Start the process, unless it was, and return the channel to it. It is not waited for: it gets ready meanwhile."""
        if self._channel is None:
            home = data_folder(self._homes, 0o700).absolute()
            environment = client_environment(home) | {"OPENBLAS_NUM_THREADS": "1"}
            command = [sys.executable, "-P", "-c", _SERVER, str(os.getpid()), "." * _PLACE_BYTES]
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._restarts.note_start()
            with theirs, self._log.open("ab") as log:
                self._process = subprocess.Popen(
                    command, stdin=theirs.fileno(), stdout=log, stderr=log, env=environment, cwd=home, start_new_session=True
                )
            ours.settimeout(_PATIENCE_S)
            self._channel = ours
        return self._channel

    def fork(self, words: Sequence[str], home: Path, log: IO[bytes]) -> ForkedProcess:
        """Run `arena` with these words in a fork, which starts at home, and says what it says to a log.

        Raises
        ------
        ArenaError
            The process to be forked died again and again; a log says why.
        """
        order = json.dumps({"words": list(words), "home": str(home)}).encode()
        while True:
            channel = self.begin()
            try:
                socket.send_fds(channel, [order], [log.fileno()])
                answer, handles, _, _ = socket.recv_fds(channel, _MOST_BYTES, 1, socket.MSG_CMSG_CLOEXEC)
            except OSError:
                answer = b""
            if answer:
                return ForkedProcess(int(answer), *handles)
            self._end()
            self._restarts.note_death()
            if self._restarts.is_reached:
                raise ArenaError(self._restarts.failure_message())

    def _end(self) -> None:
        if self._process is not None and self._channel is not None:
            self._channel.close()
            self._process.kill()
            self._process.wait()
            self._process = self._channel = None


def serve() -> None:
    """Fork for each order that comes through stdin, until that is closed; return in a fork, which is to run `arena`."""
    server = os.getpid()
    follow(int(sys.argv[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _show_as(f"arena: clients in {Path.cwd()} are forked from this process")
    for module in _MODULES:
        import_module(module)
    find_missing(fighter_kernels([_FIRST]))  # nothing is compiled here
    gc.collect()
    gc.freeze()  # or the first collection in each fork would copy all that there is
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # of forks that have ended nothing is left
    channel = socket.socket(fileno=os.dup(0))
    while True:
        order, logs, _, _ = socket.recv_fds(channel, _MOST_BYTES, 1)
        if not order:
            raise SystemExit
        if os.fork() == 0:
            break
        os.close(logs[0])
    for descriptor in (1, 2):
        os.dup2(logs[0], descriptor)
    os.close(logs[0])
    try:
        _begin(server, **json.loads(order))
    finally:  # whoever asked waits, and a fork that ends by an error has its log, too
        handle = os.pidfd_open(os.getpid())
        socket.send_fds(channel, [str(os.getpid()).encode()], [handle])
        os.close(handle)
        channel.close()


def _begin(server: int, words: Sequence[str], home: str) -> None:
    """Be as a process that was started for these words alone."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    follow(server)
    forget_keys()
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.environ["HOME"] = home
    os.chdir(home)
    sys.argv = ["arena", *words]
    _show_as(" ".join([sys.executable, "-P", "-c", RUN_ARENA, *words]))


def _show_as(command: str) -> None:
    """Have the system show this as the command of this process, in the place of the words that it was started with."""
    numbers = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    begin, end = int(numbers[45]), int(numbers[46])  # arg_start and arg_end, see proc(5)
    if n_bytes := end - begin:
        text = command.encode()[: n_bytes - 2]
        # One string, as from setproctitle: the last byte of the place is then not zero.
        ctypes.memmove(begin, text.ljust(n_bytes - 1, b"\0") + b".", n_bytes)
