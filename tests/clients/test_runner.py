"""A client whose pit is not all there yet."""

import time
from types import SimpleNamespace
from typing import Any

import pytest

from arena.errors import LostPitError
from arena.game.types import Team
from arena.network.address import free_port
from arena.network.session import open_router
from arena.protocol.bundles import read_bundle, seat_number
from arena.protocol.codec import encode
from arena.protocol.messages import Bundle
from clients import events
from clients.core import MOST_UNANSWERED
from clients.runner import TICK_S, BundleChannel, Runner
from clients.settings import ClientSettings
from policies.registry import load


def test_a_router_without_a_pit_is_asked_for_a_while() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    settings = ClientSettings(endpoint=endpoint, pit="pit", name="ann", team="any", make=load("random"), n_matches=1)
    runner = Runner(settings, on_seat=lambda _: None, on_end=lambda _: None, on_wait=lambda _: None)

    with open_router(endpoint, "pit"):
        begun_at_s = time.monotonic()
        with pytest.raises(LostPitError, match="no pit called pit answers at"):
            runner.run()

    assert time.monotonic() - begun_at_s > 0.9 * MOST_UNANSWERED * TICK_S


class Payload(bytes):
    def to_bytes(self) -> bytes:  # type: ignore[override]
        return bytes(self)


def sample(payload: bytes) -> Any:
    return SimpleNamespace(payload=Payload(payload))


BLUE, RED = seat_number(7, Team.BLUE), seat_number(8, Team.RED)


def test_answers_of_several_seats_are_published_in_one() -> None:
    published: list[bytes] = []
    channel = BundleChannel(published.append)

    channel.send()
    assert not published
    channel.add(BLUE, b"blue's")
    channel.add(RED, b"red's")
    channel.send()
    channel.send()

    assert [read_bundle(data) for data in published] == [[(BLUE, b"blue's"), (RED, b"red's")]]


def test_a_bundle_is_taken_apart_for_the_slots_that_hold_its_seats() -> None:
    channel = BundleChannel(lambda _: None)
    channel.slots = {RED: 0, BLUE: 1}
    bundle = encode(Bundle(seats=[BLUE, RED, RED + 2, BLUE], messages=[b"1", b"2", b"3", b"4"]))

    assert list(channel.take_apart(sample(bundle))) == [
        events.MessageReceived(slot, data) for slot, data in ((1, b"1"), (0, b"2"), (1, b"4"))
    ]


@pytest.mark.parametrize("junk", [b"", b"\xc1", encode(Bundle(seats=[BLUE], messages=[]))])
def test_what_is_no_bundle_is_dropped(junk: bytes) -> None:
    channel = BundleChannel(lambda _: None)
    channel.slots = {BLUE: 0}

    assert list(channel.take_apart(sample(junk))) == []
