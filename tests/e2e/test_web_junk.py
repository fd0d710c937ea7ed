"""Pages that say what no page says, over a WebSocket."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from arena.network.address import free_port

Start = Callable[..., Any]
JUNK = [
    "",
    "no json",
    b"\xff\xfe",
    "[" * 30_000,
    "null",
    '"\\ud800"',
    "1" * 10_000,
    '{"token": []}',
    '{"token": {"a": 1}}',
    '{"name": [], "team": 1, "opponent": {}}',
    '{"key": 3}',
    '{"do": "order", "action": 1e400}',
    "x" * (1 << 17),
]
N_PAGES = 3


def test_junk_on_a_websocket_harms_nobody_and_leaves_no_traceback(start: Start, tmp_path: Path) -> None:
    port = free_port()
    server = start("web", "--pit", f"tcp/127.0.0.1:{free_port()}", "--port", port, "--data", tmp_path).wait_for("web page at ")
    for path in ("/ws/play", "/ws/match/0123456789abcdef", "/ws/match/**"):
        for junk in JUNK:
            with connect(f"ws://127.0.0.1:{port}{path}", origin=f"http://127.0.0.1:{port}") as socket:  # type: ignore[arg-type]
                try:
                    socket.send(junk)
                    socket.recv(timeout=60)
                    socket.send(junk)
                except ConnectionClosed:
                    continue

    server.send(signal.SIGINT)
    assert server.finish() in (0, 130)
    assert "Traceback" not in server.said
    assert "Error" not in server.said
