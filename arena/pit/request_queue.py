"""Requests that wait to be opened, and the time that may be spent on them.

Opening a request costs a good part of a turn, so that only a share of the time goes to it: a flood of requests slows those who
want to come in, and no match.
"""

import math
from collections import deque

from arena.pit.events import JoinAsked

MOST_REQUESTS = 128
"""Requests that wait; what comes beyond is dropped, and its sender asks again."""
_SHARE = 0.3
"""Of the time, while matches run."""
_MOST_SAVED_S = 0.02
"""As much of it can be saved up, or spent before it has come, as the beginning of a match takes."""


class RequestQueue:
    """Requests in the order of their coming, and a ration of time."""

    def __init__(self) -> None:
        self._requests: deque[JoinAsked] = deque()
        self._saved_s, self._saved_at_s = _MOST_SAVED_S, math.inf

    def put(self, request: JoinAsked) -> bool:
        """Let a request wait; False if too many do."""
        if len(self._requests) >= MOST_REQUESTS:
            return False
        self._requests.append(request)
        return True

    def take(self) -> JoinAsked:
        """Return the request that has waited longest."""
        return self._requests.popleft()

    def may_take(self, *, is_rationed: bool) -> bool:
        """Whether a request waits, and there is time for it."""
        return bool(self._requests) and (not is_rationed or self._saved_s > 0)

    def save(self, now_s: float) -> None:
        """Save up the share of the time that has passed."""
        passed_s = max(now_s - self._saved_at_s, 0.0)
        self._saved_s, self._saved_at_s = min(self._saved_s + _SHARE * passed_s, _MOST_SAVED_S), now_s

    def spend(self, took_s: float) -> None:
        """Take off what opening a request took."""
        self._saved_s = max(self._saved_s - took_s, -_MOST_SAVED_S)
