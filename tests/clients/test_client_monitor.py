"""What a client tells a monitor, and keeps, of matches that are gone."""

import gc
import weakref
from typing import Any

import pytest

from arena.game.ruleset import load, rules_values
from arena.game.types import Team
from arena.metrics.definitions import MATCHES_RUNNING
from arena.protocol.messages import Ticket
from clients.feedback import Feedback
from clients.monitor import ClientMonitor
from clients.seat import Seat
from policies.registry import load as load_policy

RULES = load("paper")


def seat(match: str) -> Seat:
    ticket = Ticket(
        match=match, lane=0, team=int(Team.BLUE), ruleset=rules_values(RULES), opponent="ann", turn_time_s=None, bank_s=0.0,
        tick=0, secret=bytes(32), commitment=b"",
    )  # fmt: skip
    return Seat(ticket, bytes(32), load_policy("random"))


def n_running(monitor: ClientMonitor) -> Any:
    [found] = [reading.values for reading in monitor.read() if reading.metric is MATCHES_RUNNING]
    return found


def test_a_match_that_is_gone_does_not_run() -> None:
    monitor, gone, other = ClientMonitor(), seat("one"), seat("other")
    monitor.begin(gone)
    assert n_running(monitor) == 1

    gone.abandon()

    assert n_running(monitor) == 0
    monitor.begin(other)
    assert n_running(monitor) == 1


@pytest.mark.parametrize("make", [ClientMonitor, Feedback])
def test_a_match_that_is_gone_is_not_kept_when_the_next_begins(make: type[ClientMonitor | Feedback]) -> None:
    told, gone = make(), seat("one")
    told.begin(gone)
    gone.abandon()
    kept = weakref.ref(gone)
    del gone

    told.begin(seat("other"))

    gc.collect()
    assert kept() is None
