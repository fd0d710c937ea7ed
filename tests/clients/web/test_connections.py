"""Connections to the web server that are not what a browser would open."""

import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import uvicorn

from arena.network.address import free_port
from clients.web.connections import ImpatientProtocol
from clients.web.server import listen

GET = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
POST = b"POST /file HTTP/1.1\r\nHost: localhost\r\nContent-Length: 8\r\n\r\n"
PATIENCE_S = 60.0
Connect = Callable[[], socket.socket]


async def hello(scope: Any, receive: Any, send: Any) -> None:
    """Answer whatever is asked, whether or not all of it has come; of a file that is sent, once it has."""
    while scope["path"] == "/file" and (await receive()).get("more_body"):
        continue
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"5")]})
    await send({"type": "http.response.body", "body": b"hello"})


@pytest.fixture
def connect(monkeypatch: pytest.MonkeyPatch) -> Iterator[Connect]:
    """Serve, and connect to the server."""
    monkeypatch.setattr(ImpatientProtocol, "PATIENCE_S", 0.2)
    port = free_port()
    config = uvicorn.Config(hello, lifespan="off", http=ImpatientProtocol, log_level="warning", timeout_keep_alive=60)
    server = uvicorn.Server(config)
    with listen("127.0.0.1", port) as listening:
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield lambda: socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        finally:
            server.should_exit = True
            thread.join()


def read_to_the_end(connection: socket.socket) -> bytes:
    """Return all that the server says until it closes; `TimeoutError` if it does not."""
    pieces = []
    while piece := connection.recv(1 << 16):
        pieces.append(piece)
    return b"".join(pieces)


@pytest.mark.parametrize("half", [b"", b"G", GET[:-2], GET[:-4] + b"\r\nA: " + 1_000 * b"a"])
def test_a_request_that_is_half_sent_is_not_waited_for_for_ever(connect: Connect, half: bytes) -> None:
    with connect() as connection:
        connection.sendall(half)

        assert read_to_the_end(connection) == b""


def test_a_body_that_never_comes_is_not_waited_for_either(connect: Connect) -> None:
    with connect() as connection:
        connection.sendall(GET[:-2] + b"Content-Length: 1000\r\n\r\nabc")

        assert read_to_the_end(connection).endswith(b"hello")


def test_a_file_may_take_longer_to_come_than_a_request(connect: Connect) -> None:
    with connect() as connection:
        connection.sendall(POST + b"half")
        connection.settimeout(3 * ImpatientProtocol.PATIENCE_S)
        with pytest.raises(TimeoutError):
            connection.recv(1)
        connection.settimeout(PATIENCE_S)
        connection.sendall(b"half" + GET[:-2])

        assert read_to_the_end(connection).endswith(b"hello")


def test_a_file_that_never_comes_is_not_waited_for_for_ever(connect: Connect, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ImpatientProtocol, "FILE_PATIENCE_S", 0.2)
    with connect() as connection:
        connection.sendall(POST + b"half")

        assert read_to_the_end(connection) == b""


def test_a_second_request_that_is_half_sent_is_not_waited_for(connect: Connect) -> None:
    with connect() as connection:
        connection.sendall(GET + b"GET / HT")

        assert read_to_the_end(connection).count(b"hello") == 1


def test_whole_requests_are_answered_one_after_the_other(connect: Connect, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ImpatientProtocol, "PATIENCE_S", PATIENCE_S)
    with connect() as connection:
        for _ in range(3):
            connection.sendall(GET)
            said = b""
            while not said.endswith(b"hello"):
                said += connection.recv(1 << 16)
