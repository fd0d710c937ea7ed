"""The web page beside a pit: `arena web` as a process of its own, which knows no more of the pit than any other client."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from arena.extras import needs
from arena.network.address import Address

_GOODBYE_S = 5.0


def check() -> None:
    """Refuse, before the pit opens, a page that could not be served."""
    with needs("web", "--web"):
        for package in ("starlette", "uvicorn", "websockets"):
            import_module(package)


@contextmanager
def web_page(address: Address, port: int, data: Path, db: str, authority: Path | None) -> Iterator[None]:
    """Show a pit that is open on this machine in the browser, at a port of loopback, until the end of the block.

    The page ends with its stdin, so it does not outlive a pit that is killed; and Ctrl-C is for the pit, which ends it.
    """
    command = [sys.executable, "-c", "from tournaments.cli import main; main()", "web", "--pit", str(address.from_here())]
    command += ["--port", str(port), "--data", str(data), "--ends-with-stdin"]
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
