"""How a client plays."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from arena.policy import BatchFactory
from arena.protocol.identity import Identity
from clients.audit import Verdict
from clients.seat import Seat


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Everything that `arena join` is told."""

    endpoint: str
    pit: str
    name: str
    team: str
    make: BatchFactory
    n_matches: int | None
    """None plays until the pit has no more matches."""
    n_slots: int = 1
    """Seats that it may hold at once."""
    patience_s: float = 60.0
    """How long it tries to reach a pit that it has lost."""
    is_patient: bool = False
    """Whether the policy may need longer than a moment: it raises `clients.seat.Thinking`, and is asked again."""
    rules_hash: str = ""
    identity: Identity = field(default_factory=Identity.make)
    """Of the entry."""
    invite: str = ""
    trust: Callable[[bytes], None] = lambda _: None
    """Raises if the pit whose public key it is given is not the one that was meant."""
    authority: Path | None = None
    """Who vouches for the pit's certificate, where it listens by TLS."""
    on_audit: Callable[[Seat, Verdict], None] | None = None
    """Told what the journal of each match was found to be; without it, none is asked for."""
    transcripts: Path | None = None
    """Folder for what each seat was shown."""
