"""The web page beside a pit: `arena web` as a process of its own, which knows no more of the pit than any other client."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from arena.extras import needs
from arena.network.address import Address
from clients.web.guard import list_names

_GOODBYE_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePlace:
    """Where the page is."""

    port: int
    host: str = "127.0.0.1"
    names: tuple[str, ...] = ()
    """By which browsers reach it, beside the host."""


def check(place: PagePlace) -> None:
    """Refuse, before the pit opens, a page that could not be served."""
    list_names(place.host, place.names, "--web-")
    with needs("web", "--web"):
        for package in ("starlette", "uvicorn", "websockets", "prometheus_client"):
            import_module(package)
    from clients.web.server import listen  # with the extra only

    listen(place.host, place.port).close()


@contextmanager
def web_page(address: Address, place: PagePlace, data: Path, db: str, authority: Path | None) -> Iterator[None]:
    """Show a pit that is open on this machine in the browser, until the end of the block.

    The page ends with its stdin, so it does not outlive a pit that is killed; and Ctrl-C is for the pit, which ends it.
    """
    command = [sys.executable, "-c", "from tournaments.cli import main; main()", "web", "--pit", str(address.from_here())]
    command += ["--port", str(place.port), "--host", place.host, "--data", str(data), "--ends-with-stdin"]
    command += [word for name in place.names for word in ("--name", name)]
    command += ["--db", db] if db else []
    command += ["--authority", str(authority)] if authority is not None else []
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as process:
        try:
            yield
        finally:
            if process.stdin is not None:
                process.stdin.close()
            try:
                process.wait(_GOODBYE_S)
            except subprocess.TimeoutExpired:
                process.kill()
