"""A venue of batches, as one that goes on."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from family import PATIENCE_S
from network_settings import make_setting, plan

from arena.errors import ArenaError, InputError
from arena.game.types import Termination
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome
from tournaments.venues.local import play as play_local
from tournaments.venues.network import NetworkPit
from tournaments.venues.open_venue import BatchVenue, OpenVenue, open_venue
from tournaments.venues.setting import Fighter, VenueSetting

ENTRIES = {"one": Fighter(spec="rush"), "two": Fighter(spec="patrol"), "three": Fighter(spec="random")}


def receive_until(venue: OpenVenue, is_so: Callable[[], bool]) -> list[Outcome]:
    outcomes = venue.receive()
    give_up_at_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < give_up_at_s, outcomes
        outcomes += venue.receive()
    return outcomes


@pytest.mark.usefixtures("one_core")
def test_matches_that_come_while_a_batch_is_played_are_the_next_and_what_is_not_begun_can_be_withdrawn(tmp_path: Path) -> None:
    may_play, batches = threading.Event(), []

    def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        batches.append((sorted(setting.entries), len(plans)))
        assert may_play.wait(PATIENCE_S)
        yield from play_local(setting, plans)

    plans = [match for pair in (("one", "two"), ("one", "three"), ("three", "two")) for match in plan(*pair)]
    with BatchVenue(play, make_setting(tmp_path)) as venue:
        venue.add({name: ENTRIES[name] for name in ("one", "two")}, plans[:2])
        receive_until(venue, lambda: bool(batches))
        venue.add(ENTRIES, plans[2:])
        venue.withdraw(["three"], "gone")
        void = receive_until(venue, lambda: venue.n_left == 2)
        venue.add({}, plans[4:])
        may_play.set()
        outcomes = receive_until(venue, lambda: venue.n_left == 0)

    assert batches == [(["one", "two"], 2), (["three", "two"], 2)]
    assert [(outcome.result.ending, outcome.result.reason) for outcome in void] == [(Termination.VOID, "gone")] * 4
    assert sorted(outcome.identity for outcome in outcomes) == sorted(match.identity for match in [*plans[:2], *plans[4:]])


def test_what_a_venue_raises_is_raised_by_receive_after_what_ended_and_its_session_is_left(tmp_path: Path) -> None:
    entered = []

    @contextmanager
    def session() -> Iterator[None]:
        entered.append("in")
        try:
            yield
        finally:
            entered.append("out")

    def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        yield Outcome.void(plans[0], "a cloud")
        raise ArenaError("the cluster is gone")

    with BatchVenue(play, make_setting(tmp_path), session=session) as venue:
        venue.add(ENTRIES, plan("one", "two"))
        assert len(receive_until(venue, lambda: venue.n_left == 1)) == 1
        for _ in range(2):
            with pytest.raises(ArenaError, match="the cluster is gone"):
                receive_until(venue, lambda: False)
    assert entered == ["in", "out"]


def test_who_closes_it_waits_for_the_next_match_alone_and_gets_what_ended(tmp_path: Path) -> None:
    begun = threading.Event()

    def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        begun.set()
        while True:
            yield Outcome.void(plans[0], "")

    venue: OpenVenue = BatchVenue(play, make_setting(tmp_path))
    with venue:
        venue.add(ENTRIES, plan("one", "two")[:1])
        assert begun.wait(PATIENCE_S)

    assert len(venue.receive()) == 1, "a match counts once"


def test_a_venue_is_found_by_its_name_and_who_joins_by_itself_comes_to_the_network_alone(tmp_path: Path) -> None:
    setting = make_setting(tmp_path)

    assert isinstance(open_venue("network", setting), NetworkPit)
    with open_venue("local", setting) as venue, pytest.raises(InputError, match=r'far joins by itself.*venue = "network"'):
        venue.add({"far": Fighter(spec="key:", public_key=bytes(32))}, [])
