"""How much time a seat has."""

from dataclasses import dataclass

MOST_S = 1_000_000
"""That any clock may give; a wait of more is none that a system knows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeControl:
    """What a referee demands of a seat, in seconds."""

    turn_time_s: float | None = 1.0
    """For each turn; None runs no clock."""
    bank_s: float = 10.0
    """Extra time of a seat, for the whole match."""
    grace_s: float = 10.0
    """How long a seat may be away in the whole match, and how long it may take to get ready."""
    most_missed: int = 10
    """Turns missed in a row that forfeit the match."""
