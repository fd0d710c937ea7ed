"""What can happen to a pit, as its core takes it in."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from arena.game.types import Team
from arena.records.journal import Journal

if TYPE_CHECKING:
    from arena.pit.workers.messages import Order, Report

QuestionId = int
"""Names a question that waits for its answer; the shell chooses it, and never uses it again."""


@dataclass(frozen=True, slots=True)
class JoinAsked:
    """Somebody asks for a challenge, for a seat, or for an operator's command."""

    question: QuestionId
    payload: bytes
    session: str = ""
    """The connection that it says to come from, if it does."""


@dataclass(frozen=True, slots=True)
class LobbyAsked:
    """Somebody asks for the pit's public facts."""

    question: QuestionId


@dataclass(frozen=True, slots=True)
class JournalAsked:
    """Somebody asks for a piece of a match's journal."""

    question: QuestionId
    match: str
    payload: bytes


class ActionReceived(NamedTuple):
    """A message on the action key of a seat, from whomever. A named tuple, since every turn makes two."""

    lane: int
    team: Team
    payload: bytes
    arrived_s: float | None = None
    """When it may have arrived at the earliest, if it lay in the queue while something else was done."""


class BundleReceived(NamedTuple):
    """A message on the action key of a lane of bundles, from whomever."""

    lane: int
    payload: bytes
    arrived_s: float | None = None
    """As of an action."""


@dataclass(frozen=True, slots=True)
class ActionsTaken:
    """No more actions wait, or enough were handed in for now: what was gathered for clients is sent."""


MORE_MAY_FOLLOW = (ActionReceived, BundleReceived)
"""After these, what is gathered for clients is not sent yet."""


@dataclass(frozen=True, slots=True)
class PresenceChanged:
    """A client process came, or is gone; anybody can claim either."""

    client: str
    is_present: bool


@dataclass(frozen=True, slots=True)
class TimePassed:
    """Time has passed; to be handed in every hundredth of a second or so."""

    received_until_s: float
    """All that came before was handed in, so deadlines before it are over. The pit's own delay is charged to nobody."""


@dataclass(frozen=True, slots=True)
class RequestTurn:
    """All orders that came were handed in, so there is time for one request; see `PitCore.may_open_request`."""


@dataclass(frozen=True, slots=True)
class RequestOpened:
    """The effects of the last `RequestTurn` were carried out."""

    took_s: float
    """What it took, the effects included."""


@dataclass(frozen=True, slots=True)
class JournalsReady:
    """The files for the journals of so many new matches are open; no more than those begin."""

    n: int


@dataclass(frozen=True, slots=True)
class UnfinishedFound:
    """An earlier process of the pit left an unfinished match."""

    name: str
    """Of the journal's file."""
    journal: Journal
    entries: dict[Team, bytes]
    """Public keys of those who play."""
    nonce: bytes
    """In the match's name on the network."""
    n_bytes: int
    """Length of the journal up to its last whole record."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """The pit stops: every match is left as it stands, so that a later process can resume it."""


@dataclass(frozen=True, slots=True)
class WorkerReady:
    """A worker has started, at first or anew, and takes matches."""

    worker: int


@dataclass(frozen=True, slots=True)
class WorkerLost:
    """A worker has ended, and another is started in its place."""

    worker: int
    lane: int | None = None
    """Of the match that it was at, if it was at one."""
    is_cut_off: bool = False
    """Whether no match can have brought it down: its machine was lost, or it returns to the one that was."""


@dataclass(frozen=True, slots=True)
class WorkerSaid:
    """A worker reports."""

    worker: int
    report: "Report"


@dataclass(frozen=True, slots=True)
class Ordered:
    """To a worker: the pit orders something."""

    order: "Order"


@dataclass(frozen=True, slots=True)
class MatchTaken:
    """To a worker: a match is to be taken up where its journal stands."""

    found: UnfinishedFound
    lane: int


Event = (
    JoinAsked
    | LobbyAsked
    | JournalAsked
    | ActionReceived
    | BundleReceived
    | ActionsTaken
    | PresenceChanged
    | TimePassed
    | RequestTurn
    | RequestOpened
    | JournalsReady
    | UnfinishedFound
    | Stopped
    | WorkerReady
    | WorkerLost
    | WorkerSaid
    | Ordered
    | MatchTaken
)
