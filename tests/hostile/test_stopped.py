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
from commands import Command

from arena.network.address import free_port
from arena.protocol import topics
from arena.records.journal import Mark
from arena.records.journal_folder import load_journal
from arena.records.replay import verify

Start = Callable[..., Any]
Size = Callable[[int, int], int]
PATIENCE_S = 60.0
TOLD = [topics.all_observations("pit"), topics.all_public("pit"), topics.all_truths("pit")]
"""All that a client may subscribe to."""
TINY_BYTES = 1024
LONGEST_TICK_S = 3.0
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
        self._pit.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)  # or what the system keeps takes minutes to come
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
def proxy(pit: "Pit") -> Iterator[Callable[[], Proxy]]:
    with ExitStack() as open_ones:

        def begin() -> Proxy:
            one = Proxy(pit.port)
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


class Pit:
    """A pit for matches with much to tell, and no time to lose; and who stands by and notes when something is told."""

    def __init__(self, folder: Path, n_ticks: int) -> None:
        self.port, self._folder, self.config = free_port(), folder, folder / "config"
        self._told_s: dict[str, list[float]] = {}
        self._seen: set[Path] = set()
        time_control = ("--turn-time", 2, "--bank", 0, "--missed", 60, "--grace", 60)
        rules = ("--set", "side=64", "--set", f"tick_limit={n_ticks}", "--set", "units.ugv.attack=0")
        where = ("--listen", f"tcp/127.0.0.1:{self.port}", "--data", folder, "--seed", 7)
        self._process = Command("from tournaments.cli import main; main()", ("serve", *where, *time_control, *rules))
        self._open = ExitStack()
        self._open.callback(self._process.close)

    def listen(self) -> None:
        """Wait until it is open, and note from now on when something is told."""
        self._process.wait_for("join with: ")
        session = connect(self.port)
        self._open.callback(session.close)
        session.declare_subscriber(topics.all_public("pit"), self._note)

    def _note(self, sample: zenoh.Sample) -> None:
        self._told_s.setdefault(str(sample.key_expr), []).append(time.monotonic())

    def check(self, n_matches: int) -> None:
        """Look at the matches that have ended since the last look: nobody was late, and no tick was long."""
        played = {path: load_journal(path) for path in (self._folder / "journals").glob("*.journal") if path not in self._seen}
        ended = {path: journal for path, journal in played.items() if journal.ending is not None}
        self._seen |= ended.keys()
        told_s, self._told_s = self._told_s, {}
        assert len(ended) >= n_matches
        for path, journal in ended.items():
            assert verify(journal) > 100
            late = [number for number, tick in enumerate(journal.ticks) if any(mark & Mark.LATE for mark in tick.marks)]
            assert late == [], path.name
        assert len(told_s) >= n_matches
        assert max(later - earlier for times in told_s.values() for earlier, later in pairwise(times)) < LONGEST_TICK_S

    def close(self) -> None:
        self._open.close()


@pytest.fixture(scope="module")
def pit(size: Size, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pit]:
    pit = Pit(tmp_path_factory.mktemp("pit"), size(250, 400))
    try:
        pit.listen()
        yield pit
    finally:
        pit.close()


@pytest.fixture
def play(pit: Pit, start: Start, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Play some matches; in the middle of the first, do something."""
    monkeypatch.setenv("ARENA_CONFIG", str(pit.config))  # in which the entries keep their keys from test to test

    def go_on(n_matches: int, then: Callable[[], object] = lambda: None) -> None:
        address = f"arena://127.0.0.1:{pit.port}/pit"
        options = ("--policy", "patrol", "--matches", n_matches)
        players = [start("join", address, *options, "--name", name) for name in ("ann", "bob")]
        then()
        assert [player.finish() for player in players] == [0, 0], [player.said for player in players]
        pit.check(n_matches)

    return go_on


def test_a_stopped_listener_makes_nobody_late(play: Callable[..., None], start: Start, pit: Pit, size: Size) -> None:
    listeners = [start(pit.port, *TOLD, code=LISTENER).wait_for("listening") for _ in range(2)]

    def stop() -> None:
        for listener in listeners:
            listener.wait_for("heard").send(signal.SIGSTOP)

    play(size(2, 4), stop)


def test_a_connection_that_is_not_read_is_cut_off_and_makes_nobody_late(
    play: Callable[..., None], proxy: Callable[[], Proxy], size: Size
) -> None:
    between = proxy()
    heard = threading.Event()

    def stop() -> None:
        assert heard.wait(PATIENCE_S)
        between.stop()

    with connect(between.port, lease_ms=600_000) as session:  # the pit does not miss it before it is full
        for key in TOLD:
            session.declare_subscriber(key, lambda sample: heard.set())
        play(size(2, 5), stop)

        assert between.was_cut_off()
        between.close()


def test_connections_that_say_nothing_or_junk_or_half_of_it_make_nobody_late(
    play: Callable[..., None], proxy: Callable[[], Proxy], pit: Pit, size: Size
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
            one = silent.enter_context(tiny_socket(pit.port))
            with suppress(ConnectionError):
                one.sendall(data)

        play(size(1, 2))
