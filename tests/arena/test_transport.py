"""With real sessions over loopback."""

from collections.abc import Iterator
from queue import SimpleQueue
from threading import Event

import pytest

from arena.transport import Broadcast, Session, free_port, open_client, open_router, read_payload

WAIT_S = 10.0


@pytest.fixture
def ends() -> Iterator[tuple[Session, Session]]:
    """A router, and a client of it."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_router(endpoint) as router, open_client(endpoint) as client:
        yield router, client


def await_ears(broadcast: Broadcast, expected: bool) -> None:
    tick = Event()
    for _ in range(int(WAIT_S / 0.01)):
        if broadcast.is_heard == expected:
            return
        tick.wait(0.01)
    pytest.fail(f"is_heard stays {broadcast.is_heard}")


def test_a_broadcast_knows_who_comes_and_goes(ends: tuple[Session, Session]) -> None:
    router, client = ends
    broadcast = router.broadcast("arena/p/match/m/public")
    assert not broadcast.is_heard
    heard: SimpleQueue[bytes] = SimpleQueue()

    leave = client.subscribe("arena/*/match/*/public", lambda sample: heard.put(read_payload(sample)))
    await_ears(broadcast, True)
    broadcast.put(b"facts")

    assert heard.get(timeout=WAIT_S) == b"facts"
    leave()
    await_ears(broadcast, False)
    broadcast.end()


def test_a_broadcast_that_begins_late_knows_who_is_there(ends: tuple[Session, Session]) -> None:
    router, client = ends
    first = router.broadcast("arena/p/match/m/public")
    client.subscribe("arena/p/match/*/public", lambda sample: None)
    await_ears(first, True)

    assert router.broadcast("arena/p/match/n/public").is_heard
