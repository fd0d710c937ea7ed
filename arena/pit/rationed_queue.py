"""What waits to be done between turns, and the time that may be spent on it.

Opening a request costs a good part of a turn, and an answer to somebody who does not read costs as long as Zenoh waits for it.
Only a share of the time goes to either: a flood slows those who want the same, and no match.
"""

import math
from collections import deque
from typing import Generic, TypeVar

MOST_REQUESTS = 128
"""Requests that wait, of either kind; what comes beyond is dropped, and its sender asks again."""
_MOST_SAVED_S = 0.02
"""As much of the time can be saved up as the beginning of a match takes."""

T = TypeVar("T")


class RationedQueue(Generic[T]):
    """Requests in the order of their coming, and a ration of time.

    Parameters
    ----------
    share
        Of the time, while matches run.
    most_debt_s
        As much can be spent before it has come; what took longer is charged no further.
    """

    def __init__(self, *, share: float, most_debt_s: float = _MOST_SAVED_S) -> None:
        self._requests: deque[T] = deque()
        self._share, self._most_debt_s = share, most_debt_s
        self._saved_s, self._saved_at_s = _MOST_SAVED_S, math.inf

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._requests)

    def put(self, request: T) -> bool:
        """Let a request wait; False if too many do."""
        if len(self._requests) >= MOST_REQUESTS:
            return False
        self._requests.append(request)
        return True

    def take(self) -> T:
        """Return the request that has waited longest."""
        return self._requests.popleft()

    def may_take(self, *, is_rationed: bool) -> bool:
        """Whether a request waits, and there is time for it."""
        return bool(self._requests) and (not is_rationed or self._saved_s > 0)

    def save(self, now_s: float) -> None:
        """Save up the share of the time that has passed."""
        passed_s = max(now_s - self._saved_at_s, 0.0)
        self._saved_s, self._saved_at_s = min(self._saved_s + self._share * passed_s, _MOST_SAVED_S), now_s

    def spend(self, took_s: float) -> None:
        """Take off what a request took."""
        self._saved_s = max(self._saved_s - took_s, -self._most_debt_s)
