from typing import Any

import pytest

from arena.game.keys import MatchKeys
from arena.game.types import RULES_VERSION, Team
from arena.pit.seating import OpenSeating, Pairing, PlannedSeating
from arena.pit.seats import SlotId
from arena.protocol.messages import Closed, JoinRequest, Refusal, Wait
from arena.records.plan import MatchPlan

KEYS = MatchKeys(map_key=bytes(32), match_key=bytes(32))


def plan(blue: str, red: str, number: int = 0) -> MatchPlan:
    return MatchPlan(identity=f"{number}/{blue}/{red}", blue=blue, red=red, keys=KEYS)


def ask(seating: Any, name: str, team: str = "any", slot: int = 0) -> Any:
    """Ask for a seat as the process of an entry, and show a pairing as who plays whom."""
    request = JoinRequest(rules_version=RULES_VERSION, name=name, team=team, client=name, slot=slot)
    answer = seating.place(slot_of(name, slot), request, 0.0)
    if isinstance(answer, Pairing):
        return answer.plan.identity, answer.slots[Team.BLUE], answer.slots[Team.RED]
    return answer


def slot_of(name: str, slot: int = 0) -> SlotId:
    return SlotId(name.encode(), name, slot)


# Whoever comes


def open_seating(n_matches: int | None = None) -> OpenSeating:
    return OpenSeating(plan, n_matches)


def test_a_match_begins_when_a_red_and_a_blue_seat_are_taken() -> None:
    seating = open_seating()

    assert isinstance(ask(seating, "ann", "red"), Wait)
    assert ask(seating, "bob", "blue") == ("0/bob/ann", slot_of("bob"), slot_of("ann"))
    assert isinstance(ask(seating, "cid", "red"), Wait)


@pytest.mark.parametrize(("taken", "left"), [("blue", "red"), ("red", "blue"), ("any", "red")])
def test_any_gets_the_free_team(taken: str, left: str) -> None:
    seating = open_seating()
    ask(seating, "ann", taken)

    answer = ask(seating, "bob")

    assert answer[2 if left == "red" else 1] == slot_of("bob")


def test_a_taken_team_is_refused_with_a_hint() -> None:
    seating = open_seating()
    ask(seating, "ann", "red")

    assert ask(seating, "bob", "red") == Refusal(reason="red is taken, by ann; try blue: it is free")


def test_another_slot_of_the_same_entry_waits_in_line_and_is_seated_when_the_team_is_free() -> None:
    seating = open_seating()
    for slot in (0, 1, 2, 1):
        assert isinstance(ask(seating, "ann", "red", slot), Wait)
    assert seating.pair_up(0.0) is None

    assert ask(seating, "bob", "blue") == ("0/bob/ann", slot_of("bob"), slot_of("ann", 0))
    assert seating.pair_up(0.0) is None
    assert ask(seating, "bob", "blue") == ("0/bob/ann", slot_of("bob"), slot_of("ann", 1))
    seating.forget(slot_of("ann", 2))
    assert seating.pair_up(0.0) is None
    assert isinstance(ask(seating, "bob", "blue"), Wait)


def test_a_match_begins_when_a_team_is_free_for_who_stood_in_line() -> None:
    seating = open_seating(n_matches=2)
    for slot in (0, 1):
        ask(seating, "ann", "red", slot)
    ask(seating, "bob", "blue")
    assert isinstance(ask(seating, "cid", "blue"), Wait)

    pairing = seating.pair_up(0.0)

    assert pairing is not None
    assert pairing.slots == {Team.BLUE: slot_of("cid"), Team.RED: slot_of("ann", 1)}
    assert seating.is_done


def test_asking_again_keeps_the_seat() -> None:
    seating = open_seating()

    assert isinstance(ask(seating, "ann", "red"), Wait)
    assert isinstance(ask(seating, "ann", "red"), Wait)
    assert isinstance(ask(seating, "ann", "blue"), Wait), "a seat does not play against itself"


def test_who_goes_frees_the_team() -> None:
    seating = open_seating()
    ask(seating, "ann", "red")

    seating.forget(slot_of("ann"))
    seating.forget(slot_of("nobody"))

    assert isinstance(ask(seating, "bob", "red"), Wait)


def test_two_slots_of_one_process_may_meet() -> None:
    seating = open_seating()
    ask(seating, "ann", slot=0)

    assert ask(seating, "ann", slot=1) == ("0/ann/ann", slot_of("ann", 0), slot_of("ann", 1))


def test_after_the_last_match_the_pit_is_closed() -> None:
    seating = open_seating(n_matches=1)
    assert not seating.is_done
    ask(seating, "ann")
    ask(seating, "bob")

    assert seating.is_done
    assert isinstance(ask(seating, "ann"), Closed)


def test_a_closed_pit_begins_nothing() -> None:
    seating = open_seating()
    ask(seating, "ann")

    seating.close()

    assert seating.is_done
    assert isinstance(ask(seating, "bob"), Closed)


# A league


def test_the_first_match_whose_entries_are_there_begins() -> None:
    seating = PlannedSeating([plan("ann", "bob", 0), plan("cid", "ann", 1), plan("ann", "cid", 2)])

    assert isinstance(ask(seating, "ann"), Wait)
    assert ask(seating, "cid") == ("1/cid/ann", slot_of("cid"), slot_of("ann"))
    assert isinstance(ask(seating, "bob"), Wait)
    assert ask(seating, "ann") == ("0/ann/bob", slot_of("ann"), slot_of("bob"))
    assert not seating.is_done


def test_an_entry_whose_matches_have_all_begun_is_sent_home() -> None:
    seating = PlannedSeating([plan("ann", "bob")])
    ask(seating, "ann")
    ask(seating, "bob")

    assert seating.is_done
    assert ask(seating, "ann") == Closed(reason="all matches of ann have begun")


def test_a_stranger_is_refused() -> None:
    assert ask(PlannedSeating([plan("ann", "bob")]), "eve") == Refusal(reason="eve is no entry of this league")


def test_who_goes_is_not_waited_for() -> None:
    seating = PlannedSeating([plan("ann", "bob")])
    ask(seating, "ann")
    seating.forget(slot_of("ann"))
    seating.forget(slot_of("ann"))

    assert isinstance(ask(seating, "bob"), Wait)


def test_an_entry_meets_itself_with_two_seats() -> None:
    seating = PlannedSeating([plan("ann", "ann")])

    assert isinstance(ask(seating, "ann", slot=0), Wait)
    assert isinstance(ask(seating, "ann", slot=0), Wait)
    assert ask(seating, "ann", slot=1) == ("0/ann/ann", slot_of("ann", 0), slot_of("ann", 1))


def test_matches_that_run_already_are_off_the_plan() -> None:
    seating = PlannedSeating([plan("ann", "bob", 0), plan("bob", "ann", 1)])

    seating.withdraw(["0/ann/bob"])
    ask(seating, "ann")

    assert ask(seating, "bob")[0] == "1/bob/ann"
    assert seating.is_done


def test_a_process_with_many_slots_plays_many_matches_at_once() -> None:
    seating = PlannedSeating([plan("ann", "bob", number) for number in range(3)])
    for slot in range(3):
        ask(seating, "ann", slot=slot)

    begun = [ask(seating, "bob", slot=slot) for slot in range(3)]

    assert [identity for identity, _, _ in begun] == ["0/ann/bob", "1/ann/bob", "2/ann/bob"]
    assert {blue for _, blue, _ in begun} == {slot_of("ann", slot) for slot in range(3)}


def test_a_match_that_is_added_begins_with_slots_that_wait_already() -> None:
    seating = PlannedSeating(is_open=True)
    seating.add([], ["ann", "bob"])
    assert [ask(seating, "ann"), ask(seating, "bob")] == [Wait(reason="for an opponent")] * 2
    assert seating.pair_up(0.0) is None

    seating.add([plan("ann", "bob")])
    pairing = seating.pair_up(0.0)

    assert pairing is not None
    assert (pairing.plan.identity, pairing.slots[Team.BLUE]) == ("0/ann/bob", slot_of("ann"))
    assert seating.pair_up(0.0) is None
    assert (seating.take_begun(), seating.take_begun(), seating.waiting) == (["0/ann/bob"], [], set())
    assert not seating.is_done


def test_an_entry_without_matches_waits_until_no_more_can_be_added() -> None:
    seating = PlannedSeating(is_open=True)
    seating.add([plan("bob", "cid")], ["ann"])
    assert isinstance(ask(seating, "ann"), Wait)

    seating.finish()

    assert ask(seating, "ann") == Closed(reason="all matches of ann have begun")
    assert isinstance(ask(seating, "bob"), Wait)


def test_an_entry_that_is_dismissed_is_seated_again_once_it_is_called() -> None:
    seating = PlannedSeating([plan("ann", "bob")])
    ask(seating, "ann")

    seating.dismiss("ann")
    closed = Closed(reason="ann is not needed for now")
    assert seating.dismissal("ann") == closed
    assert isinstance(ask(seating, "bob"), Wait), "its slot waits no longer"
    assert ask(seating, "ann") == closed

    seating.call("ann")
    assert ask(seating, "ann") == ("0/ann/bob", slot_of("ann"), slot_of("bob"))


def test_what_an_entry_has_not_begun_can_be_dropped() -> None:
    seating = PlannedSeating([plan("ann", "bob", 0), plan("bob", "cid", 1), plan("cid", "ann", 2)])

    assert seating.drop(["ann"]) == ["0/ann/bob", "2/cid/ann"]
    ask(seating, "cid")

    assert ask(seating, "bob")[0] == "1/bob/cid"
