"""Who holds which seat of the matches that run: the only place that knows."""

from dataclasses import dataclass
from typing import NamedTuple

from arena.game.types import Team

Client = tuple[bytes, str]
"""A client process: its entry's public key, and its own name."""


class SlotId(NamedTuple):
    """Who asks for a seat: an entry, one of its client processes, and one of that one's slots."""

    entry: bytes
    """Public key."""
    client: str
    slot: int


class Seat(NamedTuple):
    """A seat of a match."""

    match: str
    team: Team


@dataclass(slots=True)
class _Holding:
    """A slot that holds a seat, or held it last."""

    slot: SlotId
    is_present: bool = True


class SeatBook:
    """The seats that were taken. A seat has one holder at most, and a slot holds one seat at most."""

    def __init__(self) -> None:
        self._holdings: dict[Seat, _Holding] = {}
        self._held: dict[SlotId, Seat] = {}
        """Of those who are present."""

    @property
    def n_held(self) -> int:
        """Seats that have a holder."""
        return len(self._held)

    @property
    def holders(self) -> set[Client]:
        """The clients that hold a seat."""
        return {slot[:2] for slot in self._held}

    def take(self, seat: Seat, slot: SlotId) -> None:
        """Give a seat to a slot, which leaves the one that it held; whoever held this one holds it no more."""
        self.leave(slot)
        before = self._holdings.get(seat)
        if before is not None and before.is_present:
            del self._held[before.slot]
        self._holdings[seat], self._held[slot] = _Holding(slot), seat

    def find(self, slot: SlotId) -> Seat | None:
        """Return the seat that a slot holds."""
        return self._held.get(slot)

    def leave(self, slot: SlotId) -> None:
        """Free the seat that a slot holds, if any."""
        seat = self._held.pop(slot, None)
        if seat is not None:
            self._holdings[seat].is_present = False

    def leave_all(self, client: str) -> list[Seat]:
        """Free the seats that a client process holds, and return them."""
        left = {slot: seat for slot, seat in self._held.items() if slot.client == client}
        for slot in left:
            self.leave(slot)
        return list(left.values())

    def is_held(self, seat: Seat) -> bool:
        """Whether a seat has a holder."""
        holding = self._holdings.get(seat)
        return holding is not None and holding.is_present

    def was_held_by(self, seat: Seat, slot: SlotId) -> bool:
        """Whether a slot holds a seat, or was the last to hold it."""
        holding = self._holdings.get(seat)
        return holding is not None and holding.slot == slot

    def forget(self, match: str) -> None:
        """Forget the seats of a match that is over."""
        for team in Team:
            holding = self._holdings.pop(Seat(match, team), None)
            if holding is not None and holding.is_present:
                del self._held[holding.slot]
