"""The book of seats, against a plain list of what happened."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from offline_pit import OfflinePit, Player

from arena.game.types import Team
from arena.pit import admission
from arena.pit.events import PresenceChanged
from arena.pit.seats import Seat, SeatBook, SlotId

SLOTS = [SlotId(entry, client, slot) for entry in (b"ann", b"bob") for client in ("c", "d") for slot in range(2)]
SEATS = [Seat(match, team) for match in ("m", "n") for team in Team]
BLUE, RED = Seat("m", Team.BLUE), Seat("m", Team.RED)


def test_a_slot_that_takes_another_seat_leaves_its_first() -> None:
    book = SeatBook()
    book.take(BLUE, SLOTS[0])
    book.take(RED, SLOTS[0])

    assert book.find(SLOTS[0]) == RED
    assert not book.is_held(BLUE)
    assert book.was_held_by(BLUE, SLOTS[0])


def test_a_seat_that_is_taken_by_another_slot_is_its_first_holder_s_no_more() -> None:
    book = SeatBook()
    book.take(BLUE, SLOTS[0])
    book.take(BLUE, SLOTS[1])

    assert (book.find(SLOTS[0]), book.find(SLOTS[1])) == (None, BLUE)
    assert not book.was_held_by(BLUE, SLOTS[0])


def test_a_client_that_is_gone_leaves_all_its_seats_and_no_others() -> None:
    book = SeatBook()
    book.take(BLUE, SlotId(b"ann", "c", 0))
    book.take(RED, SlotId(b"bob", "d", 0))

    assert book.leave_all("c") == [BLUE]
    assert book.leave_all("c") == []
    assert (book.is_held(BLUE), book.is_held(RED)) == (False, True)


STEPS = st.one_of(
    st.tuples(st.just("take"), st.sampled_from(SEATS), st.sampled_from(SLOTS)),
    st.tuples(st.just("leave"), st.sampled_from(SLOTS)),
    st.tuples(st.just("leave_all"), st.sampled_from(["c", "d", "e"])),
    st.tuples(st.just("forget"), st.sampled_from(["m", "n"])),
)


@given(st.lists(STEPS))
def test_a_seat_has_one_holder_and_a_slot_one_seat_whatever_happens(steps: list[tuple[str, ...]]) -> None:
    book, held = SeatBook(), dict[Seat, SlotId]()
    for step, *arguments in steps:
        getattr(book, step)(*arguments)
        match step, arguments:
            case "take", (seat, slot):
                held = {other: holder for other, holder in held.items() if holder != slot} | {seat: slot}
            case "leave", (slot,):
                held = {seat: holder for seat, holder in held.items() if holder != slot}
            case "leave_all", (client,):
                held = {seat: holder for seat, holder in held.items() if holder.client != client}
            case "forget", (match,):
                held = {seat: holder for seat, holder in held.items() if seat.match != match}

        assert {seat for seat in SEATS if book.is_held(seat)} == set(held)
        assert {book.find(slot): slot for slot in SLOTS if book.find(slot)} == held


def test_a_process_that_holds_no_seat_is_looked_for_in_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Anybody can say that a process is gone, thousands of times a second, and a pit may have thousands of seats."""
    reads: list[SlotId] = []

    class Watched(SlotId):
        @property
        def client(self) -> str:  # type: ignore[override]  # a field of a named tuple
            reads.append(self)
            return str(self[1])

    monkeypatch.setattr(admission, "SlotId", Watched)
    pit = OfflinePit()
    ann, bob = Player(pit, "ann"), Player(pit, "bob")
    for slot in range(6):
        ann.ask(slot=slot, team="red")
    for slot in range(3):
        bob.ask(slot=slot, team="blue")
    assert (pit.core.n_running, pit.core.queues["clients"]) == (3, 3)
    reads.clear()

    for is_present in (True, False):
        pit.do(PresenceChanged("stranger", is_present))

    assert not reads
    pit.do(PresenceChanged(ann.client, False))
    assert pit.core.queues["clients"] == 0
    assert all(match.is_away(Team.RED) for match in pit.core.matches)
