"""The thread that answers a monitor at `/healthz` and `/metrics`, beside whatever its process is there for."""

import logging
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from socketserver import TCPServer

from arena.errors import ArenaError, InputError
from arena.metrics.definitions import Reading
from arena.metrics.exposition import CONTENT_TYPE, check, expose

logger = logging.getLogger(__name__)

_REQUEST_S = 2.0
"""How long a monitor may take for the next word of its request."""
_REST_S = 0.05
"""After each answer: whoever asks without end costs the matches next to nothing."""
_POLL_S = 0.2

Read = Callable[[], Sequence[Reading]]
"""Returns what there is to tell; raises `ArenaError`, whose sentence the monitor gets, if the process is not well."""


@contextmanager
def serve_metrics(listen: str, read: Read, check_health: Callable[[], object] | None = None) -> Iterator[str]:
    """Answer a monitor until the end of the block.

    Parameters
    ----------
    listen
        As in "127.0.0.1:9100"; port 0 takes a free one.
    read
        What is told.
    check_health
        Raises `ArenaError` if the process is not well; `read` without it.

    Yields
    ------
    str
        Where it listens.

    Raises
    ------
    InputError
        It cannot listen there, or the library of metrics is not installed.
    """
    check()
    host, port = _parse(listen)
    try:
        server = _Server(host, port, read, check_health or read)
    except (OSError, OverflowError) as error:
        said = getattr(error, "strerror", None) or error
        raise InputError(f"--metrics cannot listen at {listen}: {said}; choose another address or port") from error
    thread = threading.Thread(target=server.serve_forever, args=(_POLL_S,), name="metrics", daemon=True)
    with server:
        thread.start()
        try:
            yield f"{host}:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def _parse(listen: str) -> tuple[str, int]:
    host, _, port = listen.rpartition(":")
    if not host or not (port.isascii() and port.isdecimal()):
        raise InputError(f"--metrics is {listen!r}; it must be HOST:PORT, as in 127.0.0.1:9100")
    return host.removeprefix("[").removesuffix("]"), int(port)


class _Server(TCPServer):
    allow_reuse_address = True

    def __init__(self, host: str, port: int, read: Read, check_health: Callable[[], object]) -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.read, self.check_health = read, check_health
        super().__init__((host, port), _Handler)

    def handle_error(self, request: object, client_address: object) -> None:
        error = sys.exception()
        if not isinstance(error, OSError):  # a monitor that left in the middle of its request
            logger.error("a monitor was not answered", exc_info=error)


class _Handler(BaseHTTPRequestHandler):
    timeout = _REQUEST_S
    server: _Server
    server_version, sys_version = "arena", ""

    def do_GET(self) -> None:  # the base class names it
        """Answer."""
        if self.path not in ("/healthz", "/metrics"):
            self._answer(HTTPStatus.NOT_FOUND, b"there are /healthz and /metrics\n")
        else:
            try:
                body = expose(self.server.read()) if self.path == "/metrics" else self._check()
            except ArenaError as error:
                self._answer(HTTPStatus.SERVICE_UNAVAILABLE, f"{error}\n".encode())
            else:
                self._answer(HTTPStatus.OK, body)
        time.sleep(_REST_S)

    def _check(self) -> bytes:
        self.server.check_health()
        return b"well\n"

    def _answer(self, status: HTTPStatus, body: bytes) -> None:
        self.send_response(status)
        self.send_header("content-type", CONTENT_TYPE)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: a monitor asks all day."""
