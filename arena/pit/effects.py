"""What the core of a pit wants done. The shell carries the effects of a call out in their order, and none after one that fails.

Those that every turn needs are named tuples: they are made in half the time of a frozen dataclass.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from arena.game.types import Team
from arena.match.seat_record import SeatRecord
from arena.pit.events import QuestionId
from arena.policy import MatchResult
from arena.records.journal import Header

if TYPE_CHECKING:
    from arena.pit.workers.messages import Order, Report


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer a question."""

    question: QuestionId
    payload: bytes


@dataclass(frozen=True, slots=True)
class Drop:
    """Leave a question without an answer."""

    question: QuestionId


@dataclass(frozen=True, slots=True)
class SaveRegister:
    """Save the register of names, invites and bans; what cannot be saved ends the pit."""


@dataclass(frozen=True, slots=True)
class ReplyWithJournal:
    """Answer a question with a piece of a journal that is closed."""

    question: QuestionId
    journal: str
    """Name of its file."""
    offset: int


@dataclass(frozen=True, slots=True)
class OpenMatch:
    """Open the channels of a match, and its journal for appending. A new one has no name before something is appended."""

    match: str
    journal: str
    """Name of its file."""
    n_bytes: int
    """Of the journal that are kept; 0 begins a new one."""
    lane: int
    """Names the keys of its seats."""


class Append(NamedTuple):
    """Append to the journal of a match, all or nothing; what cannot be written ends the pit."""

    match: str
    data: bytes


class Send(NamedTuple):
    """Send to a seat."""

    match: str
    team: Team
    payload: bytes


class SendBundle(NamedTuple):
    """Send to several seats of a client."""

    lane: int
    """Of the client's bundles."""
    payload: bytes


class PublishTick(NamedTuple):
    """Publish the tick that begins. Each message is made only if somebody subscribed to it, and before the next event."""

    match: str
    make_public: Callable[[], bytes]
    """What everyone may know."""
    make_truth: Callable[[], bytes] | None
    """All of it, sealed; None where there is no spectator key."""
    make_past_truth: Callable[[], bytes] | None = None
    """All of it as it was some ticks ago, for everyone; None where that is shown to nobody, or not yet."""


@dataclass(frozen=True, slots=True)
class PublishEnding:
    """Publish how a match ended."""

    match: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class CloseMatch:
    """Close the channels and the journal of a match."""

    match: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchEnded:
    """Report a match that ended."""

    header: Header
    result: MatchResult
    """`score` is blue's."""
    seats: dict[Team, SeatRecord]
    entries: dict[Team, bytes]
    """Public keys of those who played."""


@dataclass(frozen=True, slots=True)
class TellWorker:
    """Tell a worker."""

    worker: int
    order: "Order"


@dataclass(frozen=True, slots=True)
class TellPit:
    """Of a worker: tell the pit."""

    report: "Report"


Effect = (
    Reply
    | Drop
    | ReplyWithJournal
    | SaveRegister
    | OpenMatch
    | Append
    | Send
    | SendBundle
    | PublishTick
    | PublishEnding
    | CloseMatch
    | MatchEnded
    | TellWorker
    | TellPit
)
