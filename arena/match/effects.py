"""What a match wants done, in this order. The match itself does none of it."""

from dataclasses import dataclass

from arena.game.types import Team
from arena.policy import MatchResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Write:
    """Append these bytes to the journal, now."""

    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """Show a seat the current tick, and wait for its orders."""

    team: Team
    tick: int
    observation: bytes
    """As `arena.protocol.observation_codec.ObservationWriter` writes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Publish:
    """Publish the public facts of the tick that begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """The match is over; nothing follows."""

    result: MatchResult
    """`score` is blue's."""


Effect = Write | Ask | Publish | End
