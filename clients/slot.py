"""One of the seats that a client may hold at once: what it plays there, and what it has asked the pit."""

from dataclasses import dataclass

from arena.protocol.handshake import Attempt
from clients.seat_session import SeatSession


@dataclass(slots=True)
class Question:
    """What a slot has asked, and not heard the answer of."""

    query: int
    asked_at_s: float
    limit_s: float
    attempt: Attempt | None = None
    """The request that was sent; None while its challenge is awaited."""


@dataclass(slots=True)
class Slot:
    """One of the seats that a client may hold at once."""

    number: int
    session: SeatSession | None = None
    """Outlives a connection, so that its seat can be taken again."""
    is_open: bool = False
    """Whether the session's keys are published on and subscribed to."""
    question: Question | None = None
    n_unanswered: int = 0
    has_heard: bool = False
    """Whether the referee was heard since the last `TimePassed`."""
    heard_at_s: float = 0.0
    last_match: str = ""
    """The match that ended here last: a late ticket for it is of no use."""
    is_done: bool = False
