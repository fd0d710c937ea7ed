"""Machines that `ssh` reaches, for a pit to run workers on: each an SSH server, on loopback or in a network of its own."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from arena.errors import ArenaError
from arena.jit import cache_root
from arena.network.address import free_port

ARENA = "from tournaments.cli import main; main()"
"""The `arena` command, for Python."""
_START_S = 60.0
_PATH = f"{os.environ['PATH']}:/usr/sbin"


class FarMachine:
    """An SSH server, and all that runs by it."""

    def __init__(self, folder: Path, port: int, namespace: str = "") -> None:
        self.port, self._namespace = port, namespace
        self._settings = folder / f"sshd-{port}"
        self._settings.write_text(
            f"Port {port}\nListenAddress 0.0.0.0\nHostKey {folder}/key\nAuthorizedKeysFile {folder}/key.pub\nStrictModes no\n"
            "PidFile none\nUsePAM no\nPermitRootLogin yes\nAllowUsers *\n"
        )
        self._folder = folder
        self.start()

    @property
    def host(self) -> str:
        """What `ssh` calls it."""
        return f"m{self.port}"

    def start(self) -> None:
        """Be there; it answers in a moment."""
        with suppress(OSError):
            Path("/run/sshd").mkdir(exist_ok=True)  # of root's server alone
        within = ["ip", "netns", "exec", self._namespace] if self._namespace else []
        command = [shutil.which("sshd", path=_PATH) or "sshd", "-D", "-e", "-f", str(self._settings)]
        self.server = subprocess.Popen([*within, *command], stderr=subprocess.DEVNULL, start_new_session=True)

    def wait(self) -> None:
        """Wait until it answers; `ArenaError` if it does not."""
        end_s = time.monotonic() + _START_S
        command = [*ssh_of(self._folder).split(), self.host, "true"]
        while (done := subprocess.run(command, capture_output=True, text=True, check=False)).returncode:
            if time.monotonic() > end_s:
                raise ArenaError(f"an SSH server of our own does not answer: {done.stderr.strip()}")
            time.sleep(0.05)

    def processes(self) -> list[int]:
        """Return the process ids of all that it runs, the server among them."""
        parents = {}
        for status in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                parents[int(status.parent.name)] = int(status.read_text().rsplit(")", 1)[1].split()[1])
        found = [self.server.pid]
        for pid in found:
            found += [child for child, parent in parents.items() if parent == pid]
        return found

    def workers(self) -> list[int]:
        """Return those that referee."""
        return [pid for pid in self.processes() if ARENA.encode() in _command_line(pid).split(b"\0")]

    def send(self, number: signal.Signals) -> None:
        """Send a signal to all of it at once."""
        for pid in self.processes():
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    def die(self) -> None:
        """End it, as by a power cut."""
        self.send(signal.SIGSTOP)  # nothing notices the end of another
        self.send(signal.SIGKILL)
        self.server.wait()


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def ssh_of(folder: Path) -> str:
    """Return the command that reaches machines of a folder, by `m` and their port."""
    return f"ssh -F {folder}/config"


def program_of(folder: Path) -> Path:
    """Return the `arena` of machines of a folder."""
    return folder / "arena"


@dataclass(frozen=True)
class Network:
    """A network namespace, and its one link to this machine, as far as that is let be."""

    name: str
    link: str
    address: str

    def cut(self) -> None:
        """Let nothing through."""
        _ip("link", "set", self.link, "down")

    def mend(self) -> None:
        """Let everything through again."""
        _ip("link", "set", self.link, "up")

    def disturb(self, *how: str) -> None:
        """Delay or lose what goes through, as `tc netem` has it; `ArenaError`, with a reason, where the kernel has none."""
        command = ["tc", "qdisc", "replace", "dev", self.link, "root", "netem", *how]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ArenaError(f"{' '.join(command)}: {done.stderr.strip()}")


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


@contextmanager
def networks(n: int) -> Iterator[list[Network]]:
    """Yield networks with a machine each; `ArenaError`, with a reason, where none may be made."""
    number = os.getpid() % 200
    made = [Network(f"arena{number}-{k}", f"arena{number}v{k}", f"10.{200 + k}.{number}.2") for k in range(n)]
    with ExitStack() as running:
        for one in made:
            try:
                _ip("netns", "add", one.name)
                running.callback(_ip, "netns", "del", one.name)
                _ip("link", "add", one.link, "type", "veth", "peer", "name", "eth0", "netns", one.name)
                running.callback(_ip, "link", "del", one.link)
                _ip("addr", "add", f"{one.address[:-1]}1/24", "dev", one.link)
                one.mend()
                _ip("-n", one.name, "addr", "add", f"{one.address}/24", "dev", "eth0")
                _ip("-n", one.name, "link", "set", "eth0", "up")
                _ip("-n", one.name, "link", "set", "lo", "up")
            except (OSError, subprocess.CalledProcessError) as error:
                said = error.stderr.decode().strip() if isinstance(error, subprocess.CalledProcessError) else ""
                raise ArenaError(f"no network namespace can be made: {said or error}") from None
        yield made


@contextmanager
def far_machines(folder: Path, n: int, within: Sequence[Network] = ()) -> Iterator[list[FarMachine]]:
    """Yield machines that `ssh_of` reaches as their `host`, in networks of their own if given.

    Raises
    ------
    ArenaError
        There is no SSH server, or none that answers; in words that can stand behind "no, because".
    """
    if shutil.which("ssh-keygen") is None or shutil.which("sshd", path=_PATH) is None:
        raise ArenaError("there is no SSH server (apt-get install openssh-server)")
    folder.mkdir()
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / "key"], check=True)
    ports = [free_port() for _ in range(n)]
    addresses = [one.address for one in within] or ["127.0.0.1"] * n
    hosts = "".join(
        f"Host m{port}\n  Port {port}\n  HostName {address}\n" for port, address in zip(ports, addresses, strict=True)
    )
    (folder / "config").write_text(
        f"{hosts}Host m*\n  IdentityFile {folder}/key\n  IdentitiesOnly yes\n  LogLevel ERROR\n"
        "  StrictHostKeyChecking no\n  UserKnownHostsFile /dev/null\n"
    )
    program = program_of(folder)
    program.write_text(f'#!/bin/sh\nNUMBA_CACHE_DIR={cache_root()} exec {sys.executable} -c "{ARENA}" "$@"\n')
    program.chmod(0o700)
    with ExitStack() as running:
        machines = []
        for k, port in enumerate(ports):
            machines.append(FarMachine(folder, port, within[k].name if within else ""))
            running.callback(machines[-1].die)
        for machine in machines:
            machine.wait()
        yield machines
