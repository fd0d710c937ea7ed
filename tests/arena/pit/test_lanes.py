"""Numbers that matches use one after another."""

from offline_pit import RULES, OfflinePit, begin, play

from arena.pit.lanes import REST_S, Lanes


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
