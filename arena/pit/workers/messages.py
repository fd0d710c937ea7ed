"""What a pit and its workers say to each other over their pipes. Workers are the pit's own processes, of the same version.

A worker on another machine cannot write into the pit's folder: it sends what belongs into a journal, and nothing that follows
from it leaves that worker before the pit says that it stands.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.match.seat_record import SeatRecord
from arena.match.time_control import TimeControl
from arena.pit.events import QuestionId
from arena.pit.match_sessions import NewMatch
from arena.pit.seats import Seat
from arena.policy import MatchResult
from arena.protocol.handshake import Caller
from arena.protocol.messages import Signed

# What a worker is told


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerSettings:
    """All that a worker needs; the first that it is told."""

    number: int
    """Of the worker, from 1."""
    endpoint: str
    """Where the pit's router takes workers."""
    pit: str
    private: bytes
    """The pit's key."""
    spectator_key: bytes | None
    public_delay: int
    ruleset: Ruleset
    time_control: TimeControl
    journals: Path
    fsync: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeMatch:
    """Referee a match."""

    match: str
    """What it is called on the network."""
    new: NewMatch
    is_resumed: bool = False
    """Whether an earlier process may have begun it: then its journal says where it stands."""
    given_up: str = ""
    """Why it is to be void at once, without being played again: it has brought down too many workers."""
    left: bytes | None = None
    """Its journal as the pit has it, for a worker on another machine; None if there is none."""


@dataclass(frozen=True, slots=True)
class GiveSeat:
    """Give a seat to who asks for it."""

    seat: Seat
    caller: Caller
    question: QuestionId


@dataclass(frozen=True, slots=True)
class LeaveSeat:
    """The process that held a seat is gone."""

    seat: Seat


@dataclass(frozen=True, slots=True)
class ForfeitSeat:
    """Have a seat forfeit its match."""

    seat: Seat
    why: str


@dataclass(frozen=True, slots=True)
class VoidMatch:
    """End a match by a fault that is no seat's."""

    match: str
    why: str
    only_unready: bool = False
    """Unless it has begun meanwhile."""


@dataclass(frozen=True, slots=True)
class StopWork:
    """Sign what is over, leave all else as it stands, and end."""


@dataclass(frozen=True, slots=True)
class Stand:
    """What a worker on another machine sent for its journals stands there."""

    n_pieces: int
    """From the first on."""


Order = TakeMatch | GiveSeat | LeaveSeat | ForfeitSeat | VoidMatch | StopWork | Stand

# What a worker says


@dataclass(frozen=True, slots=True)
class Room:
    """How many matches the worker has taken so far, and how many more it could."""

    n_taken: int
    n_free: int


@dataclass(frozen=True, slots=True)
class SeatGiven:
    """The answer to who asked for a seat, sealed; None if its match does not run."""

    question: QuestionId
    payload: bytes | None


@dataclass(frozen=True, slots=True)
class Over:
    """How a match ended."""

    match: str
    result: MatchResult
    seats: Mapping[Team, SeatRecord]
    ending: Signed


@dataclass(frozen=True, slots=True)
class Shut:
    """The journal of a match is closed."""

    match: str
    has_journal: bool


@dataclass(frozen=True, slots=True)
class Gone:
    """A match that cannot be taken up."""

    match: str
    why: str


@dataclass(frozen=True, slots=True)
class MatchProgress:
    """Where a match stands."""

    tick: int
    is_waiting: bool
    """Whether its seats are not ready yet."""
    faults: Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What a worker costs."""

    processor_s: float = 0.0
    resident_bytes: int = 0
    n_files: int = 0
    n_threads: int = 0


@dataclass(frozen=True, slots=True)
class Progress:
    """How the worker and its matches are, twice a second."""

    matches: Mapping[str, MatchProgress]
    load: Load


@dataclass(frozen=True, slots=True)
class Failed:
    """The worker cannot go on, and neither would another: as where the disk is full."""

    reason: str


class Piece(NamedTuple):
    """What is to be appended to a journal."""

    match: str
    journal: str
    """Name of its file."""
    n_before: int
    """Bytes that stand before it; after none, a new journal begins."""
    data: bytes


@dataclass(frozen=True, slots=True)
class Written:
    """What a worker on another machine appended to journals, in this order."""

    pieces: tuple[Piece, ...]


Report = Written | Room | SeatGiven | Over | Shut | Gone | Progress | Failed
