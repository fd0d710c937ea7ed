"""Bundles: the sealed messages of several seats of one client in one, so that Zenoh, threads and wake-ups are paid for once.

Bundling is outside the seal: every message stays sealed by its own seat's keys, and a bundle is worth no more than its parts.
Whoever changes one can lose messages, as whoever stands between the two can anyway, and can change none.
"""

from arena.errors import UnreadableError
from arena.game.types import Team
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.messages import Bundle

MOST_MESSAGES = 256
"""In a bundle."""
_MOST_BUNDLED_BYTES = MOST_BYTES - 4_000
"""Of all messages of a bundle; the longest there is, a piece of a history, fits by itself."""
_TEAMS = tuple(Team)
_EXTRA_BYTES = 10
"""What a message needs in a bundle beside its own bytes, at most: its seat's number, and its length."""


def seat_number(lane: int, team: Team) -> int:
    """Return what a seat is called in a bundle."""
    return 2 * lane + team


def read_seat_number(number: int) -> tuple[int, Team]:
    """Return the lane and the team of a seat in a bundle."""
    return number >> 1, _TEAMS[number & 1]


def read_bundle(data: bytes) -> list[tuple[int, bytes]]:
    """Return the messages of a bundle, each behind the number of its seat, in their order.

    Raises
    ------
    UnreadableError
        The bytes are no bundle, or one of too many messages.
    """
    bundle = decode(data)
    if not isinstance(bundle, Bundle):
        raise UnreadableError("this is no bundle")
    if len(bundle.seats) != len(bundle.messages):
        raise UnreadableError(f"a bundle names {len(bundle.seats)} seats for {len(bundle.messages)} messages")
    if len(bundle.seats) > MOST_MESSAGES:
        raise UnreadableError(f"a bundle has {len(bundle.seats)} messages; none has more than {MOST_MESSAGES}")
    return list(zip(bundle.seats, bundle.messages, strict=True))


class BundleWriter:
    """Gathers messages until they are taken as bundles."""

    def __init__(self) -> None:
        self._full: list[bytes] = []
        self._seats: list[int] = []
        self._messages: list[bytes] = []
        self._n_bytes = 0

    def __bool__(self) -> bool:
        """Whether anything waits to be taken."""
        return bool(self._seats or self._full)

    def add(self, seat: int, message: bytes) -> None:
        """Add a sealed message of a seat."""
        n_bytes = len(message) + _EXTRA_BYTES
        if self._seats and (self._n_bytes + n_bytes > _MOST_BUNDLED_BYTES or len(self._seats) == MOST_MESSAGES):
            self._close()
        self._seats.append(seat)
        self._messages.append(message)
        self._n_bytes += n_bytes

    def take(self) -> list[bytes]:
        """Return what was added since the last call, as few bundles."""
        if self._seats:
            self._close()
        full, self._full = self._full, []
        return full

    def _close(self) -> None:
        self._full.append(encode(Bundle(seats=self._seats, messages=self._messages)))
        self._seats, self._messages, self._n_bytes = [], [], 0
