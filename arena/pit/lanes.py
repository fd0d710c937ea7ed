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
    within
        The numbers that there are, where others are somebody else's.
    """

    def __init__(self, first: int, within: range | None = None) -> None:
        self._next, self._within = first, within
        self._resting: deque[tuple[float, int]] = deque()
        """When each may be used again, the first to be so first."""

    def take(self, now_s: float) -> int:
        """Return a lane that no match uses."""
        if self._resting and self._resting[0][0] <= now_s:
            return self._resting.popleft()[1]
        lane, self._next = self._next, self._next + 1
        if self._within is not None and self._next == self._within.stop:
            self._next = self._within.start
        return lane

    def give_back(self, lane: int, now_s: float) -> None:
        """Let a lane rest."""
        self._resting.append((now_s + REST_S, lane))
