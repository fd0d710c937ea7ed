"""What a match wants done, in this order. The match itself does none of it.

Those that every turn needs are named tuples: they are made in half the time of a frozen dataclass.
"""

from dataclasses import dataclass
from typing import NamedTuple

from arena.game.types import Team
from arena.policy import MatchResult


class Write(NamedTuple):
    """Append these bytes to the journal, now."""

    data: bytes


class Ask(NamedTuple):
    """Show a seat the current tick, and wait for its orders."""

    team: Team
    tick: int
    observation: bytes
    """As `arena.protocol.observation_codec.ObservationWriter` writes it."""
    charged_us: int
    """What the seat was charged for the turn before, as `arena.protocol.messages.Turn` has it."""
    is_new: bool
    """Whether the clock of the turn begins with this, and it is not asked again."""


class Publish(NamedTuple):
    """Publish the public facts of the tick that begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """The match is over; nothing follows."""

    result: MatchResult
    """`score` is blue's."""


Effect = Write | Ask | Publish | End
