"""A PostgreSQL of our own, which may be killed and started again, for benchmarks and tests; a running service is left alone."""

import os
import pwd
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from arena.errors import ArenaError

PASSWORD = "not a secret"
START_S = 60.0


class Cluster:
    """A PostgreSQL server that can be killed, and started again on the same port."""

    def __init__(self, programs: Path, folder: Path, user: dict[str, Any]) -> None:
        self._programs, self._folder, self._user = programs, folder, user
        self._databases = (f"store_{number}" for number in count(1))
        self._server: subprocess.Popen[bytes] | None = None
        self._dead_since_s: float | None = None
        self.port = find_free_port()
        password = folder / "password"
        password.write_text(PASSWORD)
        password.chmod(0o644)
        initdb: list[str | Path] = [
            programs / "initdb", "-D", folder / "data", "-U", "arena", "--no-sync", "--encoding=UTF8", "--locale=C.UTF-8",
            "--auth=scram-sha-256", f"--pwfile={password}",
        ]  # fmt: skip
        subprocess.run(initdb, check=True, stdout=subprocess.DEVNULL, cwd=folder, **user)

    def url(self, database: str, *, user: str = "arena", password: str = PASSWORD) -> str:
        """Return where a database is."""
        return f"postgresql://{user}:{password.replace(' ', '%20')}@127.0.0.1:{self.port}/{database}"

    def make_database(self) -> str:
        """Return the URL of a new and empty database."""
        import psycopg

        name = next(self._databases)
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}".encode())
        return self.url(name)

    def start(self) -> None:
        """Start the server, and wait until it takes connections."""
        command: list[str | Path] = [
            self._programs / "postgres", "-D", self._folder / "data", "-p", str(self.port), "-k", self._folder,
            "-c", "listen_addresses=127.0.0.1", "-c", "fsync=off",  # processes are killed here, the power is never cut
        ]  # fmt: skip
        if shutil.which("setpriv"):  # end with whoever started it, however that ends
            command = ["setpriv", "--pdeathsig", "QUIT", *command]
        is_ready: list[str | Path] = [self._programs / "pg_isready", "-q", "-h", "127.0.0.1", "-p", str(self.port)]
        give_up_at_s = time.monotonic() + START_S
        with (self._folder / "log").open("ab") as log:
            while True:
                server = self._server
                if server is None or server.poll() is not None:  # it refuses to start while children of a killed one are left
                    server = subprocess.Popen(command, stdout=log, stderr=log, cwd=self._folder, **self._user)
                    self._server = server
                if subprocess.run(is_ready, check=False).returncode == 0 and server.poll() is None:
                    return
                if time.monotonic() > give_up_at_s:
                    raise TimeoutError((self._folder / "log").read_text(errors="replace")[-2_000:])
                try:
                    server.wait(timeout=0.05)
                except subprocess.TimeoutExpired:
                    continue

    def tend(self, restart_s: float) -> None:
        """Start the server again, so long after its end was seen here first."""
        if self._server is None or self._server.poll() is None:
            self._dead_since_s = None
            return
        self._dead_since_s = self._dead_since_s or time.monotonic()
        if time.monotonic() - self._dead_since_s >= restart_s:
            self.start()

    def find(self) -> list[int]:
        """Return the server's process and those of all its children; none if it is dead."""
        if self._server is None or self._server.poll() is not None:
            return []
        children = Path(f"/proc/{self._server.pid}/task/{self._server.pid}/children")
        return [self._server.pid, *(map(int, children.read_text().split()) if children.exists() else ())]

    def kill(self) -> None:
        """Kill the server and all its children, as a machine does that runs out of memory."""
        assert self._server is not None
        for pid in self.find() or [self._server.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        self._server.wait()

    def stop(self) -> None:
        """End it."""
        if self._server is not None and self._server.poll() is None:
            self._server.send_signal(signal.SIGQUIT)
            self._server.wait(timeout=START_S)


def find_free_port() -> int:
    """Return a port that no client is given by the system, so that it stays free while the server is down."""
    for port in random.SystemRandom().sample(range(15_000, 32_000), 100):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                return port
    raise OSError("no port is free")


@contextmanager
def open_cluster() -> Iterator[Cluster]:
    """Start a cluster for as long as the block lasts.

    Raises
    ------
    ArenaError
        This machine has no PostgreSQL, or none that we may run; in words that can stand behind "no, because".
    """
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: float(path.parts[-3]))
    program = found[-1] if found else shutil.which("initdb")
    if program is None:
        raise ArenaError("PostgreSQL is not installed (apt-get install postgresql)")
    user: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="arena-pg-", ignore_cleanup_errors=True) as name:
        if os.geteuid() == 0:  # PostgreSQL refuses to run as root; the package brings a user
            try:
                owner = pwd.getpwnam("postgres")
            except KeyError:
                raise ArenaError("PostgreSQL does not run as root, and there is no user postgres") from None
            os.chown(name, owner.pw_uid, owner.pw_gid)
            user = {"user": owner.pw_uid, "group": owner.pw_gid, "extra_groups": []}
        cluster = Cluster(Path(program).resolve().parent, Path(name), user)
        try:
            cluster.start()
            yield cluster
        finally:
            cluster.stop()
