"""Requests for something else than a seat: of the operator to a pit, of an entry's owner to a season; and what both answer.

They are signed and sealed as a `JoinRequest` is, and are messages like all others, see `arena.protocol.messages`.
"""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class AdminRequest:
    """The operator asks, who holds the pit's own key and signs with it."""

    command: str
    """kick, ban, close, abort or release-name."""
    target: str
    """A name, a public key or a match."""
    entry: bytes = b""
    """The pit's key; this and what follows as in `JoinRequest`."""
    ephemeral: bytes = b""
    reply_secret: bytes = b""
    challenge: bytes = b""
    pit_key: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """What was asked for is done."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonRequest:
    """An entry's owner asks a season for something; a submission comes in pieces, a request for each."""

    command: str
    """upload, remote, status, log, roll-back or withdraw."""
    name: str
    """Of the entry."""
    invite: str = ""
    digest: bytes = b""
    """SHA-256 of the whole submission."""
    n_bytes: int = 0
    """Of the whole submission."""
    offset: int = 0
    """Where the piece, or the part of the log that is asked for, begins."""
    piece: bytes = b""
    number: int = 0
    """The version to go back to."""
    entry: bytes = b""
    """The owner's key; this and what follows as in `JoinRequest`."""
    ephemeral: bytes = b""
    reply_secret: bytes = b""
    challenge: bytes = b""
    pit_key: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonAnswer:
    """What a season answers to an entry's owner, where it does not refuse."""

    text: str
    """What was done, or how it stands."""
    offset: int = 0
    """Where the next piece of an upload, or the next part of the log, begins."""
    data: bytes = b""
    """A part of the log."""
    facts: dict[str, Any] = field(default_factory=dict)
    """How the entry stands, as `arena submit --status --json` prints it."""
