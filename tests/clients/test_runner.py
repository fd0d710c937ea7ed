"""A client whose pit is not all there yet."""

import time

import pytest

from arena.errors import LostPitError
from arena.network.address import free_port
from arena.network.session import open_router
from clients.core import MOST_UNANSWERED
from clients.runner import TICK_S, Runner
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
