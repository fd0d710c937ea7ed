"""Who holds which seat of the matches that run: the only place that knows."""

from collections.abc import Iterator
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

    @property
    def holders(self) -> set[Client]:
        """The clients that hold a seat."""
        return {holding.slot[:2] for _, holding in self._present()}

    def take(self, seat: Seat, slot: SlotId) -> None:
        """Give a seat to a slot, which leaves the one that it held; whoever held this one holds it no more."""
        self.leave(slot)
        self._holdings[seat] = _Holding(slot)

    def find(self, slot: SlotId) -> Seat | None:
        """Return the seat that a slot holds."""
        return next((seat for seat, holding in self._present() if holding.slot == slot), None)

    def leave(self, slot: SlotId) -> None:
        """Free the seat that a slot holds, if any."""
        seat = self.find(slot)
        if seat is not None:
            self._holdings[seat].is_present = False

    def leave_all(self, client: str) -> list[Seat]:
        """Free the seats that a client process holds, and return them."""
        left = [(seat, holding) for seat, holding in self._present() if holding.slot.client == client]
        for _, holding in left:
            holding.is_present = False
        return [seat for seat, _ in left]

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
            self._holdings.pop(Seat(match, team), None)

    def _present(self) -> Iterator[tuple[Seat, _Holding]]:
        return ((seat, holding) for seat, holding in self._holdings.items() if holding.is_present)
