"""The settings of a client: the pit, the entry, the policy, and how long to try."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from arena.policy import BatchFactory
from arena.protocol.identity import Identity
from clients.audit import Verdict
from clients.seat import Seat


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientSettings:
    """How a client plays; what `arena join` makes of its options."""

    endpoint: str
    pit: str
    name: str
    team: str
    make: BatchFactory
    n_matches: int | None
    """None plays until the pit has no more matches."""
    n_slots: int = 1
    """Seats to hold at once, at most."""
    patience_s: float = 60.0
    """How long to look for a pit that is not open yet, or was lost."""
    is_patient: bool = False
    """Whether the policy may raise `arena.policy.Thinking`, to be asked again."""
    count_ready: Callable[[], int] = lambda: sys.maxsize
    """Returns how many matches the policy could begin at once; no more seats than that are asked for."""
    rules_hash: str = ""
    identity: Identity = field(default_factory=Identity.make)
    """Of the entry."""
    invite: str = ""
    version: str = ""
    """As in `arena.protocol.messages.JoinRequest`."""
    trust: Callable[[bytes], None] = lambda _: None
    """Raises if the pit whose public key it is given is not the one that was meant."""
    authority: Path | None = None
    """PEM file of the certificates to trust, where the pit listens by TLS."""
    on_audit: Callable[[Seat, Verdict], None] | None = None
    """Called with the verdict on the journal of each match; None fetches no journals."""
    transcripts: Path | None = None
    """Folder for transcripts of what each seat was shown; None keeps none."""
    explains: bool = False
    """Whether the policy is to note in them what it believed, weighed and took, which takes it time."""
