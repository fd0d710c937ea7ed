"""What happens to a client, and what its core wants done about it: the two sides of `ClientCore.receive`.

Those that every turn needs are named tuples: they are made in half the time of a frozen dataclass.
"""

from dataclasses import dataclass
from typing import NamedTuple

from arena.errors import LostPitError
from arena.game.types import Team
from clients.audit import Verdict
from clients.seat import Seat

# Events


@dataclass(frozen=True, slots=True)
class Connected:
    """A connection to the pit's router is open; nothing is subscribed to yet."""


@dataclass(frozen=True, slots=True)
class Disconnected:
    """The connection is closed, or could not be opened: its subscriptions and unanswered queries are gone."""

    failure: LostPitError
    """What to raise if the pit is given up."""


@dataclass(frozen=True, slots=True)
class TimePassed:
    """Some time has passed over a connection that still stands, and all that had arrived by now was handed in.

    So an answer that lies unread while a policy thinks is not taken for silence.
    """


class MessageReceived(NamedTuple):
    """A message arrived on the observation key of a slot's seat."""

    slot: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class ReplyReceived:
    """A query has its answer."""

    query: int
    payload: bytes
    """Empty if nobody answered in time."""


@dataclass(frozen=True, slots=True)
class Woken:
    """A policy that raised `Thinking` may have its answer now."""


Event = Connected | Disconnected | TimePassed | MessageReceived | ReplyReceived | Woken

# Effects


@dataclass(frozen=True, slots=True)
class Query:
    """Query a key of the pit; the answer, or its absence, is to come back as `ReplyReceived`."""

    id: int
    key: str
    payload: bytes
    timeout_s: float


@dataclass(frozen=True, slots=True)
class OpenSeat:
    """Publish on a seat's action key, and subscribe to its observation key; nothing is to be done where both are open."""

    slot: int
    lane: int
    team: Team
    bundle_lane: int | None = None
    """Where the seat's messages go in bundles instead; None if they do not."""


@dataclass(frozen=True, slots=True)
class CloseSeat:
    """Leave both keys of a slot's seat."""

    slot: int


class Publish(NamedTuple):
    """Publish on the action key of a slot's seat."""

    slot: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Reconnect:
    """Close the connection and open another: no pit answers over this one."""


@dataclass(frozen=True, slots=True)
class MatchBegun:
    """A seat was taken in a match that is new to this client."""

    seat: Seat


@dataclass(frozen=True, slots=True)
class MatchEnded:
    """The match of a seat is over."""

    seat: Seat


@dataclass(frozen=True, slots=True)
class Waiting:
    """There is nothing to play at the moment."""

    reason: str


@dataclass(frozen=True, slots=True)
class Audited:
    """The journal of a seat's match was checked, or could not be had."""

    seat: Seat
    verdict: Verdict


Effect = Query | OpenSeat | CloseSeat | Publish | Reconnect | MatchBegun | MatchEnded | Waiting | Audited
