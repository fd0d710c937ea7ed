"""Those who are told things and do not listen: whoever plays besides is not late."""

import json
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import zenoh

from arena.protocol import topics
from arena.records.journal import Mark, load_journal
from arena.referee.replay import verify

Start = Callable[..., Any]
PATIENCE_S = 60.0
TOLD = [topics.all_observations("pit"), topics.all_public("pit"), topics.all_truths("pit")]
"""All that a client may subscribe to."""
TINY_BYTES = 1024
LONGEST_TICK_S = 1.5
"""A pit that waits for who does not read stands still for 5 s, and charges nobody."""
LISTENER = """
import json, sys, threading, zenoh
config = zenoh.Config()
config.insert_json5("mode", json.dumps("client"))
config.insert_json5("connect/endpoints", json.dumps(["tcp/127.0.0.1:" + sys.argv[1]]))
session = zenoh.open(config)
heard = [session.declare_subscriber(key, lambda sample: print("heard", flush=True)) for key in sys.argv[2:]]
session.get("arena/pit/lobby", lambda reply: print("listening", flush=True))
threading.Event().wait()
"""


class Proxy:
    """Stands between a client and the pit with a tiny window towards the pit, and stops to read when it is told."""

    def __init__(self, pit_port: int) -> None:
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._door.getsockname()[1])
        self._pit_port = pit_port
        self._is_stopped = threading.Event()
        self.first = b""
        """What the client opens with."""
        self._thread = threading.Thread(target=self._accept)
        self._thread.start()

    def _accept(self) -> None:
        self._client, _ = self._door.accept()
        self._pit = tiny_socket(self._pit_port)
        ways = [
            threading.Thread(target=self._pass_on, args=way) for way in ((self._client, self._pit), (self._pit, self._client))
        ]
        for way in ways:
            way.start()
        for way in ways:
            way.join()

    def _pass_on(self, one: socket.socket, other: socket.socket) -> None:
        one.settimeout(0.1)
        with suppress(ConnectionError):
            while not self._is_stopped.is_set():
                with suppress(TimeoutError):
                    data = one.recv(TINY_BYTES)
                    if not data:
                        return
                    self.first = self.first or data
                    other.sendall(data)

    def stop(self) -> None:
        """Pass nothing on any more, and keep both connections."""
        self._is_stopped.set()
        self._thread.join(PATIENCE_S)

    def was_cut_off(self) -> bool:
        """Read what the pit has sent since, and return whether it let go of this connection."""
        self._pit.settimeout(PATIENCE_S)
        try:
            while self._pit.recv(1 << 16):
                pass
        except TimeoutError:
            return False
        except ConnectionError:
            return True
        return True

    def close(self) -> None:
        self.stop()
        for one in (self._client, self._pit, self._door):
            one.close()


def tiny_socket(port: int) -> socket.socket:
    """Connect with a window of the least that there is."""
    one = socket.socket()
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, TINY_BYTES)
    one.connect(("127.0.0.1", port))
    return one


@pytest.fixture
def proxy(port: int) -> Iterator[Callable[[], Proxy]]:
    with ExitStack() as open_ones:

        def begin() -> Proxy:
            one = Proxy(port)
            open_ones.callback(one.close)
            return one

        yield begin


def connect(port: int, lease_ms: int = 10_000) -> zenoh.Session:
    """Enter the pit's network."""
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"),
        ("connect/endpoints", [f"tcp/127.0.0.1:{port}"]),
        ("scouting/multicast/enabled", False),
        ("transport/link/tx/lease", lease_ms),
    ):
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


@pytest.fixture
def play(serve: Start, join: Start, port: int, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Open a pit for matches with much to tell; what is returned plays some, with no time to lose."""
    told_s: dict[str, list[float]] = {}
    options = (
        "--turn-time",
        0.5,
        "--bank",
        0,
        "--missed",
        60,
        "--grace",
        60,
        "--set",
        "side=64",
        "--set",
        "tick_limit=400",
        "--set",
        "units.ugv.attack=0",
    )
    serve(*options)
    session = connect(port)
    session.declare_subscriber(
        topics.all_public("pit"), lambda sample: told_s.setdefault(str(sample.key_expr), []).append(time.monotonic())
    )

    def go_on(n_matches: int) -> None:
        players = [join("--policy", "patrol", "--name", name, "--matches", n_matches) for name in ("ann", "bob")]
        assert [player.finish() for player in players] == [0, 0]
        played = [load_journal(path) for path in (tmp_path / "journals").glob("*.journal")]
        ended = [journal for journal in played if journal.ending is not None]
        assert len(ended) >= n_matches
        for journal in ended:
            assert verify(journal) > 100
            assert not any(mark & Mark.LATE for tick in journal.ticks for mark in tick.marks)
        assert len(told_s) >= n_matches
        assert max(later - earlier for times in told_s.values() for earlier, later in pairwise(times)) < LONGEST_TICK_S

    yield go_on
    session.close()


def test_a_stopped_listener_makes_nobody_late(play: Callable[[int], None], start: Start, port: int) -> None:
    listeners = [start(port, *TOLD, code=LISTENER).wait_for("listening") for _ in range(2)]
    play(1)
    for listener in listeners:
        listener.wait_for("heard").send(signal.SIGSTOP)

    play(3)


def test_a_connection_that_is_not_read_is_cut_off_and_makes_nobody_late(
    play: Callable[[int], None], proxy: Callable[[], Proxy]
) -> None:
    between = proxy()
    session = connect(between.port, lease_ms=600_000)  # the pit does not miss it before it is full
    heard = threading.Event()
    for key in TOLD:
        session.declare_subscriber(key, lambda sample: heard.set())
    play(1)
    assert heard.is_set()

    between.stop()
    play(4)

    assert between.was_cut_off()
    between.close()
    session.close()


def test_connections_that_say_nothing_or_junk_or_half_of_it_make_nobody_late(
    play: Callable[[int], None], proxy: Callable[[], Proxy], port: int
) -> None:
    between = proxy()
    connect(between.port).close()
    opening = between.first
    assert len(opening) > 10
    frame = (65_535).to_bytes(2, "little")
    said = [
        b"",
        opening,
        opening[: len(opening) // 2],
        opening[:1],
        opening[:2],
        opening * 50,
        frame,
        frame + bytes(65_535),
        b"\0" * 9,
    ]
    with ExitStack() as silent:
        for data in said * 4:
            one = silent.enter_context(tiny_socket(port))
            with suppress(ConnectionError):
                one.sendall(data)

        play(2)
