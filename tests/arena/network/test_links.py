"""Whom a router that is nearly full lets go of, with real sockets."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from arena.network import session as sessions
from arena.network.address import free_port
from arena.network.capacity import Capacity
from arena.network.links import Kept, choose, read_peer
from arena.network.session import Session, open_client, open_router

CAPACITY = Capacity(sessions=16, pending=8)
WAIT_S = 30.0
NOBODY = Kept()


def test_the_oldest_of_the_most_crowded_address_go_first() -> None:
    crowd = [("10.0.0.1", port) for port in range(4)]
    few = [("10.0.0.2", 7), ("10.0.0.2", 8)]

    assert choose([*few, *crowd], 3) == [*crowd[:2], few[0]] or choose([*few, *crowd], 3) == crowd[:3]
    assert choose([*few, *crowd], 2) == crowd[:2]
    assert sorted(choose([*few, *crowd], 9)) == sorted(crowd + few)
    assert choose(crowd, 0) == choose(crowd, -1) == []


def test_a_customer_s_ipv6_addresses_are_one_crowd() -> None:
    crowd = [(f"2001:db8:1:2::{number}", number) for number in range(3)]
    other = [("2001:db8:1:3::1", 1), ("2001:db8:1:3::2", 2)]

    assert choose([*other, *crowd], 1) == crowd[:1]


@pytest.mark.parametrize(
    ("locator", "peer"),
    [("tcp/127.0.0.1:7447", ("127.0.0.1", 7447)), ("tls/[::1]:80", ("::1", 80)), ("unixsock-stream//tmp/x", ("", 0))],
)
def test_peers_are_read_from_locators(locator: str, peer: tuple[str, int]) -> None:
    assert read_peer(locator) == peer


@pytest.fixture
def router(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Session, int]]:
    monkeypatch.setattr(sessions, "find_capacity", lambda: CAPACITY)
    port = free_port()
    with open_router(f"tcp/127.0.0.1:{port}", "p") as one:
        yield one, port


def await_links(router: Session, n: int) -> dict[tuple[str, int], str]:
    """Wait until so many connections are known, and return them."""
    assert router.links is not None
    end_s, pause = time.monotonic() + WAIT_S, threading.Event()
    while len(router.links.sessions) != n:
        assert time.monotonic() < end_s
        router.links.take_events()
        pause.wait(0.01)
    return dict(router.links.sessions)


def relieve_until(router: Session, kept: Kept, is_over: Callable[[], bool]) -> int:
    n_cut, now_s, pause = 0, 0.0, threading.Event()
    end_s = time.monotonic() + WAIT_S
    while not is_over():
        assert time.monotonic() < end_s
        now_s += 1.0
        n_cut += router.relieve(lambda: kept, now_s)
        pause.wait(0.01)
    return n_cut


def test_a_full_router_lets_go_of_strangers_and_keeps_those_that_somebody_vouches_for(router: tuple[Session, int]) -> None:
    pit, port = router
    assert pit.links is not None
    with ExitStack() as open_ones:
        first, second, *_ = [open_ones.enter_context(open_client(f"tcp/127.0.0.1:{port}")) for _ in range(CAPACITY.sessions)]
        kept = Kept(always={first.name}, longest={second.name})
        before = await_links(pit, CAPACITY.sessions)

        assert pit.relieve(lambda: kept, 0.0) == CAPACITY.sessions / 4
        assert pit.relieve(lambda: kept, 0.05) == 0, "ten times a second"

        cut = [peer for peer in list(before)[: CAPACITY.sessions // 4 + 2] if before[peer] not in (first.name, second.name)]
        relieve_until(pit, kept, lambda: not set(cut) & set(pit.links.sessions))  # type: ignore[union-attr]  # it is a router
        assert {peer for peer in before if before[peer] in (first.name, second.name)} < set(pit.links.sessions)


def test_those_who_asked_go_last_and_those_who_are_seated_never(router: tuple[Session, int]) -> None:
    pit, port = router
    with ExitStack() as open_ones:
        everybody = [open_ones.enter_context(open_client(f"tcp/127.0.0.1:{port}")).name for _ in range(CAPACITY.sessions)]
        await_links(pit, CAPACITY.sessions)

        assert pit.relieve(lambda: Kept(always=everybody[:14], longest=everybody), 0.0) == 2
        await_links(pit, CAPACITY.sessions)  # they connected anew
        assert pit.relieve(lambda: Kept(always=everybody), 1.0) == 0


def test_those_who_connect_and_say_nothing_keep_nobody_out(router: tuple[Session, int]) -> None:
    pit, port = router
    with ExitStack() as open_ones:
        silent = [open_ones.enter_context(socket.create_connection(("127.0.0.1", port))) for _ in range(4 * CAPACITY.pending)]

        came = threading.Event()

        def enter() -> None:
            open_ones.enter_context(open_client(f"tcp/127.0.0.1:{port}"))
            came.set()

        begun_s = time.monotonic()
        threading.Thread(target=enter).start()
        relieve_until(pit, NOBODY, came.is_set)

        assert len(silent) == 4 * CAPACITY.pending
        assert time.monotonic() - begun_s < sessions._ACCEPT_TIMEOUT_MS / 1_000
