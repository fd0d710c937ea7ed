"""Every message of the protocol: frozen, valid once built. What each looks like as bytes is `codec`'s business.

A match, message by message; `handshake` says how the first four are sealed, `sealing` the rest:

    client                          referee
    ChallengeRequest -- query join -->
                  <---- reply ----  Challenge
    SealedRequest -- query join -->                 a JoinRequest, sealed
                  <---- reply ----  SealedAnswer    a Ticket, or Wait (ask again), or Refusal, or Closed, sealed
    Ready         ---- action ---->                 subscribed, policy loaded
                  <- observation -  History         to one who came back: what it was shown, and answered, before
    Ready         ---- action ---->                 and then once more: all of that was seen, the clock may start
                  <- observation -  Turn            tick by tick
    Orders        ---- action ---->
                  <- observation -  Signed          holds Ended
    Receipt       ---- action ---->
                  <---- public ---  PublicState, Signed   what everyone may know
                  <---- truth ----  Truth           to holders of the spectator key
                  <--- delayed ---  Signed          holds PastTruth, where the pit shows boards to everyone with a delay
"""

from dataclasses import dataclass, field
from typing import Any

from arena.protocol.requests import AdminRequest as AdminRequest
from arena.protocol.requests import Done as Done
from arena.protocol.requests import SeasonAnswer as SeasonAnswer
from arena.protocol.requests import SeasonRequest as SeasonRequest

PROTOCOL_VERSION = 4
"""Rises with every change of a message, except of one as `LATER` makes it."""
LATER = {"is_left_out_at_default": True}
"""Metadata of a last field that came later: left out at its default, so that old programs read the rest, and refuse another."""
UNKNOWN_US = -1
"""Of what a turn was charged: it was the first, or was played before the pit came back."""
MOST_US = 2**32 - 2
"""No turn is charged more; each number up to it fits in 4 bytes, with one to spare."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChallengeRequest:
    """A client asks for the pit's keys."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Challenge:
    """The pit's keys, for some seconds."""

    pit_key: bytes
    """Ed25519: who the pit is."""
    sealing_key: bytes
    """X25519: what requests are sealed to; made anew by every process."""
    number: bytes
    """To be repeated in the request."""
    signature: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedRequest:
    """A request that only the pit can read."""

    sealed: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedAnswer:
    """What only the sender of the request can read."""

    sealed: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinRequest:
    """A client asks for a seat; it may ask for several, each under a slot of its own."""

    rules_version: int
    name: str
    """Of the entry."""
    team: str
    """red, blue or any."""
    client: str
    """Chosen by the client process, so that its questions can be told from those of another of its name."""
    slot: int
    rules_hash: str = ""
    """The ruleset that the client insists on, if any."""
    match: str = ""
    """The match that it plays already, if it asks whether that still runs."""
    invite: str = ""
    entry: bytes = b""
    """Ed25519, the entry's own; it signs the request. This and what follows, `handshake.Attempt` fills in."""
    ephemeral: bytes = b""
    """X25519: what the answer is sealed to."""
    reply_secret: bytes = b""
    """The client's share of the seat's keys."""
    challenge: bytes = b""
    pit_key: bytes = b""
    version: str = field(default="", metadata=LATER)
    """Tells the entry's code from that of its other versions, as a chunk; empty if the client does not say."""
    bundles: bool = field(default=False, metadata=LATER)
    """Whether the client would rather have the messages of all its seats in bundles."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ticket:
    """A seat in a match."""

    match: str
    lane: int
    """Names the keys of its seats while it runs; see `arena.protocol.topics`."""
    team: int
    ruleset: dict[str, Any]
    """As `arena.game.ruleset.to_dict` gives it, and its name."""
    opponent: str
    turn_time_s: float | None
    """None where no clock runs."""
    bank_s: float
    tick: int
    """Where the match stands: 0, unless the client came back."""
    secret: bytes
    """The pit's share of the seat's keys."""
    commitment: bytes
    """A `Signed` with the match's `Commitment`."""
    public_delay: int = field(default=0, metadata=LATER)
    """Ticks after which the pit shows everyone the board, while the match runs; 0 if it shows it to nobody."""
    bundle_lane: int | None = field(default=None, metadata=LATER)
    """Names the keys on which this seat's messages go in bundles; None if they go one by one on the seat's own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signed:
    """A message that the pit stands for, whoever carries it."""

    data: bytes
    """A message as bytes."""
    signature: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Commitment:
    """What ties the pit to a match's keys before the first tick."""

    match: str
    digest: bytes
    """As `arena.protocol.signed.commit` gives it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """No seat yet: ask again."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """No seat, and asking again does not help."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """No more matches for this entry: all is played."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Ready:
    """The seat listens, and its policy is loaded.

    The referee sends who lacks ticks the history of them, once a ticket, and waits for another `Ready` before it asks.
    """

    known_ticks: int
    """Observations that the seat has, from the first on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """One observation, to be answered."""

    tick: int
    observation: bytes
    """As `arena.protocol.observation_codec.ObservationWriter` writes it: of one length per ruleset."""
    charged_us: int = UNKNOWN_US
    """What the pit's clock charged the seat for the turn before, in microseconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """A piece of what a seat was shown and answered before it came back."""

    first_tick: int
    observations: list[bytes]
    orders: list[bytes]
    """As they were played, beside `observations`."""
    end_tick: int
    """The tick at which the match stands, and the last piece ends; who has seen all before it says `Ready`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Orders:
    """A seat's answer to one observation."""

    tick: int
    actions: bytes
    """int8 each, one per unit; -1 where the policy gave no readable answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a match ended; the same to both seats and to everyone."""

    match: str
    ending: str
    winner: str | None
    score: int
    """Blue's."""
    ticks: int
    reason: str
    """Why, if it was forfeited or void."""
    faults: dict[str, dict[str, int]] = field(default_factory=dict)
    """By team: what was counted against it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Receipt:
    """A seat's word on what it was shown, once the match is over."""

    n_shown: int
    """Observations that it was shown."""
    head: bytes
    """Of its transcript: what stands for all of them."""
    signature: bytes
    """By the entry; see `arena.protocol.signed`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicState:
    """What both teams, and everyone else, may know of a running match."""

    tick: int
    names: list[str]
    """Of blue's entry, and red's."""
    living: list[int]
    """Blue's units, red's."""
    score: int
    """Blue's."""
    commitment: bytes
    """A `Signed` with the match's `Commitment`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """A tick as it is, for holders of the spectator key while the match runs."""

    tick: int
    board: bytes
    """int8 each, in the codes of Table 2, row by row."""
    seen: list[bytes]
    """What blue's seat is shown, and red's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PastTruth(Truth):
    """A tick as it was, for everyone, in a pit that shows boards with a delay."""

    match: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalRequest:
    """Somebody asks for a piece of a journal."""

    offset: int


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalPiece:
    """A piece of a journal that may be seen."""

    n_bytes: int
    """Of the whole journal."""
    offset: int
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Lobby:
    """What everyone may know of a pit."""

    pit: str
    rules: str
    """Name of the ruleset."""
    rules_hash: str
    ruleset: dict[str, Any]
    """As in `Ticket`."""
    needs_invite: bool
    n_begun: int
    """Matches since the pit opened."""
    running: list[dict[str, Any]]
    """match, blue, red, tick of each."""
    waiting: list[str]
    """Names of those who wait for an opponent."""
    standings: list[dict[str, Any]] = field(default_factory=list)
    """Of a ladder, the best first: name, rating, mu, sigma, wins, draws, losses, forfeits of each; else empty."""
    public_delay: int = field(default=0, metadata=LATER)
    """As in `Ticket`, of every match."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """Sealed messages of several seats of one client in one, in their order; bundles are not sealed themselves."""

    seats: list[int]
    """Of each message: twice the lane of its seat, and one more for red."""
    messages: list[bytes]


Message = (
    ChallengeRequest
    | Challenge
    | SealedRequest
    | SealedAnswer
    | JoinRequest
    | AdminRequest
    | Done
    | Ticket
    | Wait
    | Refusal
    | Closed
    | Ready
    | Turn
    | History
    | Orders
    | Signed
    | Commitment
    | Ended
    | Receipt
    | PublicState
    | Truth
    | JournalRequest
    | JournalPiece
    | Lobby
    | PastTruth
    | SeasonRequest
    | SeasonAnswer
    | Bundle
)
