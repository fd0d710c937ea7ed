"""Every message of the protocol: frozen, valid once built. What each looks like as bytes is `codec`'s business.

A match, message by message:

    client                          referee
    JoinRequest   -- query join -->
                  <---- reply ----  Ticket, or Wait (ask again), or Refusal, or Closed
    Ready         ---- action ---->                 subscribed, policy loaded
                  <- observation -  History         to one who came back: what it was shown, and answered, before
                  <- observation -  Turn            tick by tick
    Orders        ---- action ---->
                  <- observation -  Ended
                  <---- public ---  Facts           what everyone may know
"""

from dataclasses import dataclass, field
from typing import Any

PROTOCOL_VERSION = 1
"""Rises with every change of a message."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinRequest:
    """A client asks for a seat; it may ask for several, each under a slot of its own."""

    version: int = PROTOCOL_VERSION
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Ticket:
    """A seat in a match."""

    match: str
    team: int
    ruleset: dict[str, Any]
    """As `arena.game.ruleset.to_dict` gives it, and its name."""
    opponent: str
    turn_time_s: float | None
    """None where no clock runs."""
    bank_s: float
    tick: int
    """Where the match stands: 0, unless the client came back."""


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
    """The seat listens, and its policy is loaded."""

    known_ticks: int
    """Observations that the seat has had already; the referee sends what it had before it vanished beyond these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """One observation, to be answered."""

    tick: int
    observation: bytes
    """As `arena.protocol.sight.pack` gives it: of one length per ruleset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """A piece of what a seat was shown and answered before it came back."""

    first_tick: int
    observations: list[bytes]
    orders: list[bytes]
    """As they were played, beside `observations`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Orders:
    """A seat's answer to one observation."""

    tick: int
    actions: bytes
    """int8 each, one per unit; -1 where the policy gave no readable answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a match ended; the same to both seats and to everyone."""

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
class Facts:
    """What both teams, and everyone else, may know of a running match."""

    tick: int
    living: list[int]
    """Blue's units, red's."""
    score: int
    """Blue's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lobby:
    """What everyone may know of a pit."""

    pit: str
    rules: str
    """Name of the ruleset."""
    rules_hash: str
    n_begun: int
    """Matches since the pit opened."""
    running: list[dict[str, Any]]
    """match, blue, red, tick of each."""
    waiting: list[str]
    """Names of those who wait for an opponent."""


Message = JoinRequest | Ticket | Wait | Refusal | Closed | Ready | Turn | History | Orders | Ended | Facts | Lobby
