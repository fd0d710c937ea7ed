"""Numbers that matches use one after another."""

from itertools import pairwise

import pytest
from offline_pit import RULES, OfflinePit, begin, play

from arena.errors import UnreadableError
from arena.game.types import Team
from arena.pit.lanes import REST_S, Lanes
from arena.protocol import topics


def test_a_lane_is_used_again_once_it_has_rested_and_there_are_as_few_as_matches_at_once() -> None:
    lanes = Lanes(first=10)
    assert [lanes.take(0.0), lanes.take(0.0)] == [10, 11]

    lanes.give_back(11, 0.0)
    lanes.give_back(10, 1.0)

    assert lanes.take(REST_S - 0.1) == 12
    assert [lanes.take(REST_S), lanes.take(REST_S), lanes.take(REST_S + 1.0)] == [11, 13, 10]


def test_matches_one_after_another_share_their_keys() -> None:
    pit = OfflinePit()
    lanes = set()
    for number in range(5):
        ann, bob = begin(pit, f"ann-{number}", f"bob-{number}")
        lanes.add(ann.ticket.lane)
        play(ann, bob)
        for player in (ann, bob):
            player.give_receipt()
        pit.pass_time(REST_S)

    assert len(lanes) == 1


def test_what_comes_late_from_a_match_that_is_over_meets_no_other() -> None:
    pit = OfflinePit()
    ann, bob = begin(pit)
    play(ann, bob)
    for player in (ann, bob):
        player.give_receipt()
    eve, dan = begin(pit, "eve", "dan")

    ann.give_receipt()
    play(eve, dan, n_ticks=RULES.tick_limit)

    assert not any(n for seat in pit.ended[-1].seats.values() for n in seat.faults().values())


def test_what_comes_after_a_lane_has_rested_is_not_forged_in_its_next_match() -> None:
    pit = OfflinePit()
    ann, bob = begin(pit)
    play(ann, bob)
    for player in (ann, bob):
        player.give_receipt()
    pit.pass_time(REST_S)
    eve, dan = begin(pit, "eve", "dan")
    assert eve.ticket.lane == ann.ticket.lane

    ann.order()  # its process was stopped for as long
    play(eve, dan)

    assert not any(n for seat in pit.ended[-1].seats.values() for n in seat.faults().values())


def test_each_worker_has_lanes_of_its_own_and_hears_no_others() -> None:
    lanes = [topics.lanes_of_worker(worker) for worker in range(1, topics.MOST_WORKERS + 1)]
    heard = [topics.actions_of_worker("pit", worker).replace("$*", "").removesuffix("/*/action") for worker in (1, 2, 64)]

    assert all(one.stop == other.start for one, other in pairwise(lanes))
    for worker, prefix in zip((1, 2, 64), heard, strict=True):
        for lane in (lanes[worker - 1].start, lanes[worker - 1].stop - 1):
            key = topics.action("pit", lane, Team.RED)
            assert [key.startswith(one) for one in heard] == [one == prefix for one in heard]
            assert topics.read_action(key) == (lane, Team.RED)
        assert topics.beat_of_worker("pit", worker).startswith(prefix)
        with pytest.raises(UnreadableError):
            topics.read_action(topics.beat_of_worker("pit", worker))


def test_lanes_within_a_range_begin_again_at_its_start() -> None:
    lanes = Lanes(first=12, within=range(10, 13))

    assert [lanes.take(0.0) for _ in range(3)] == [12, 10, 11]
