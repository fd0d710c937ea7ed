"""Where the workers of a pit run: here, or on another machine, where `ssh` starts them."""

import os
import secrets
import shlex
import signal
import socket
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

from arena.errors import InputError
from arena.network.access import WORKERS_PROTOCOL
from arena.protocol.topics import MOST_WORKERS

_SSH_ENV = "ARENA_SSH"
"""The command that stands for `ssh`, with options of its own."""
_OPTIONS = (
    "-T",
    *("-o", "BatchMode=yes"),  # nobody is there to type a password
    *("-o", "ControlPath=none"),  # a connection that others share would outlive this process
    *("-o", "ExitOnForwardFailure=yes"),
    *("-o", "ConnectTimeout=5"),
    *("-o", "ServerAliveInterval=1"),
    *("-o", "ServerAliveCountMax=4"),
)
_LOST = 255
"""What `ssh` ends with that lost its machine, or never reached it."""
_LAST_WORDS_S = 1.0
"""Within which it ends, once its streams are closed."""
_START_S = 120.0
"""How long a worker may take to say its version."""
_MOST_VERSION_BYTES = 1_000
"""What comes first of a machine whose shell prints something is no version."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine that referees matches of a pit."""

    host: str = ""
    """As `ssh` takes it; empty for this one."""
    program: str = "arena"
    """What is run there."""

    def __str__(self) -> str:
        return self.host or "this machine"


HERE = Machine()


def parse_machine(text: str, program: str) -> list[Machine]:
    """Read `HOST=N`: a machine for each of its N workers; one without a number."""
    host, equals, number = text.partition("=")
    if not host or host.startswith("-") or any(character.isspace() for character in host):
        raise InputError(f"{text!r} names no machine; write HOST=N, with HOST as ssh takes it, such as ann@10.0.0.2=4")
    if equals and not (number.isascii() and number.isdigit() and 0 < int(number) <= MOST_WORKERS):
        raise InputError(f"{text!r} does not say how many workers; write HOST=N with N from 1 to {MOST_WORKERS}")
    return [Machine(host, program)] * int(number or 1)


class FarProcess:
    """A worker on another machine, as `ssh` that runs it; it ends when this ends, and the other way round.

    Its streams are the pipe, and its connections to a socket there come out of `endpoint`, the pit's own for workers, here. One
    without that is only asked for its version, and what `ssh` complains of is not shown.
    """

    def __init__(self, machine: Machine, endpoint: str = "") -> None:
        # The other machine's own choice of folder is not known yet; what sshd listens at is its user's alone.
        self.endpoint = f"{WORKERS_PROTOCOL}//tmp/arena-{secrets.token_hex(16)}"
        """Where the pit's router is reached over there."""
        there, here = self.endpoint.partition("/")[2], endpoint.partition("/")[2]
        try:
            ours, theirs = socket.socketpair()
        except OSError as error:
            raise InputError(f"cannot talk to {machine}: {error.strerror}") from error
        self.pipe = Connection(ours.detach())
        forward = ["-R", f"{there}:{here}"] if here else []
        command = [*_ssh(), *_OPTIONS, *forward, machine.host, _command(machine.program)]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=theirs.fileno(),
                stdout=theirs.fileno(),
                stderr=None if here else subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C in a terminal is for the pit, which tells its workers
            )
        except OSError as error:
            raise InputError(
                f"cannot run {command[0]}: {error.strerror}; install an SSH client, or leave out --machine"
            ) from error
        finally:
            theirs.close()

    @property
    def is_cut_off(self) -> bool:
        """Whether it ends since its machine is not reached, or says nothing any more."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_LAST_WORDS_S)
        return self._process.returncode in (_LOST, -signal.SIGKILL, None)

    def kill(self) -> None:
        """End it; what runs over there ends as its streams do."""
        self._process.kill()

    def join(self) -> None:
        """Wait until it has ended."""
        self._process.wait()


def ask(machine: Machine) -> bytes:
    """Return what a worker there says first, and have it end; nothing if the machine does not answer."""
    try:
        asked = FarProcess(machine)
    except InputError:
        return b""  # no process can be started here
    said = hear_first(asked.pipe)
    asked.pipe.close()
    asked.kill()
    asked.join()
    return said


def hear_first(pipe: Connection) -> bytes:
    """Return what a worker says first; nothing if it does not come as far."""
    try:
        return pipe.recv_bytes(_MOST_VERSION_BYTES) if pipe.poll(_START_S) else b""
    except (EOFError, OSError):
        return b""


def _command(program: str) -> str:
    """Return what runs a worker, for whatever shell: it ends with a status, where `ssh` would tell a signal as a lost machine."""
    return f"exec sh -c {shlex.quote(f'{shlex.quote(program)} worker; exit $?')}"


def _ssh() -> Sequence[str]:
    return shlex.split(os.environ.get(_SSH_ENV, "ssh"))
