"""The lanes of a pit: numbers that name the keys of a match's seats while it runs, and are used again.

Zenoh keeps every key that a client ever declared, and matches each new one with all of them: with keys of its own, every match
cost the pit memory for ever, and more time than the one before.
"""

from collections import deque

REST_S = 5.0
"""How long a lane rests after a match, so that what comes late is not taken for the next match's."""


class Lanes:
    """Gives out lanes; there are as many as were ever needed at once.

    Parameters
    ----------
    first
        The first number; another for each process of a pit, so that what is still on its way to an earlier one meets no match.
    """

    def __init__(self, first: int) -> None:
        self._next = first
        self._resting: deque[tuple[float, int]] = deque()
        """When each may be used again, the first to be so first."""

    def take(self, now_s: float) -> int:
        """Return a lane that no match uses."""
        if self._resting and self._resting[0][0] <= now_s:
            return self._resting.popleft()[1]
        self._next += 1
        return self._next - 1

    def give_back(self, lane: int, now_s: float) -> None:
        """Let a lane rest."""
        self._resting.append((now_s + REST_S, lane))
