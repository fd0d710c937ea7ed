"""What was counted of one seat in one match."""

from dataclasses import dataclass, field


@dataclass(slots=True, kw_only=True)
class SeatRecord:
    """What was counted of one seat. A number that is not 0 is shown when the match ends."""

    late: int = 0
    """Turns without an answer in time; of a tick that the ending cut off, nothing is counted."""
    unreadable: int = 0
    """Turns with an answer that was not one legal action per unit."""
    stale: int = 0
    """Messages that the match has no use for: orders for a tick that was not asked, or others than those that count; ignored.

    The answer to a turn that was ruled late is none when it comes, and neither is a copy of what was taken.
    """
    garbled: int = 0
    """Messages of the seat's holder that were none; ignored."""
    forged: int = 0
    """Messages on the seat's key that another made than who held it, now or before; ignored, and not the holder's doing."""
    vanished: int = 0
    """Times that the process or its link was gone; one that is slow is late."""
    latencies_s: list[float] = field(default_factory=list)

    def faults(self) -> dict[str, int]:
        """Return the counts."""
        return {name: getattr(self, name) for name in ("late", "unreadable", "stale", "garbled", "forged", "vanished")}
