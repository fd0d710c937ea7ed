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


class SlotsByClient:
    """Slots by the names of their processes: anybody may say of any name that its process is gone, and most have none."""

    def __init__(self) -> None:
        self._slots: dict[str, dict[SlotId, None]] = {}

    def add(self, slot: SlotId) -> None:
        """Note a slot, unless it is noted."""
        self._slots.setdefault(slot.client, {})[slot] = None

    def remove(self, slot: SlotId) -> None:
        """Forget a slot that is noted."""
        slots = self._slots[slot.client]
        del slots[slot]
        if not slots:
            del self._slots[slot.client]

    def find(self, client: str) -> list[SlotId]:
        """Return the slots of a process, the first first."""
        return list(self._slots.get(client, ()))


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
        self._by_client = SlotsByClient()

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
            self._release(before.slot)
        self._holdings[seat], self._held[slot] = _Holding(slot), seat
        self._by_client.add(slot)

    def find(self, slot: SlotId) -> Seat | None:
        """Return the seat that a slot holds."""
        return self._held.get(slot)

    def leave(self, slot: SlotId) -> None:
        """Free the seat that a slot holds, if any."""
        if slot in self._held:
            self._holdings[self._release(slot)].is_present = False

    def leave_all(self, client: str) -> list[Seat]:
        """Free the seats that a client process holds, and return them."""
        left = {slot: self._held[slot] for slot in self._by_client.find(client)}
        for slot in left:
            self.leave(slot)
        return list(left.values())

    def _release(self, slot: SlotId) -> Seat:
        self._by_client.remove(slot)
        return self._held.pop(slot)

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
                self._release(holding.slot)
