"""What a client tells a monitor: what it plays, how it ended, how long its policy thought, and whether it reaches its pit."""

import time
from collections import Counter

from arena.metrics.definitions import (
    FAULTS,
    MATCHES_ENDED,
    MATCHES_RUNNING,
    PIT_REACHABLE,
    THINK_SECONDS,
    TICKS,
    TURN_BOUNDS_S,
    Histogram,
    Reading,
)
from clients.seat import Seat

_LOST_S = 2.0
"""Without a sign of life over a connection for so long, none stands, or the policy holds the client up."""


class ClientMonitor:
    """The counts of one client; `read` is called by one thread, all else by the client's."""

    def __init__(self) -> None:
        self._seats: tuple[Seat, ...] = ()
        self._endings: Counter[str] = Counter()
        self._faults: Counter[str] = Counter()
        self._n_ticks = 0
        self._thought = Histogram(TURN_BOUNDS_S)
        self._seen_at_s = -_LOST_S

    def see(self) -> None:
        """Take note that a connection stands."""
        self._seen_at_s = time.monotonic()

    def begin(self, seat: Seat) -> None:
        """Count a seat that was taken, and let go of those whose matches are gone."""
        self._n_ticks += sum(one.known_ticks for one in self._seats if one.is_gone)
        self._seats = (*(one for one in self._seats if not one.is_gone), seat)

    def count(self, seat: Seat) -> None:
        """Count a match that is over."""
        self._seats = tuple(one for one in self._seats if one is not seat)
        self._endings[seat.result().ending.name.lower()] += 1
        self._n_ticks += seat.known_ticks
        self._thought.add(seat.took_s.values())
        if seat.ended is not None:
            self._faults.update(seat.ended.faults.get(seat.team.name.lower(), {}))

    def read(self) -> list[Reading]:
        """Return what there is to tell."""
        seats = self._seats
        return [
            Reading(MATCHES_RUNNING, sum(not seat.is_gone for seat in seats)),
            Reading(MATCHES_ENDED, dict(self._endings)),
            Reading(TICKS, self._n_ticks + sum(seat.known_ticks for seat in seats)),
            Reading(FAULTS, dict(self._faults)),
            Reading(THINK_SECONDS, self._thought.copy()),
            Reading(PIT_REACHABLE, float(time.monotonic() - self._seen_at_s < _LOST_S)),
        ]
