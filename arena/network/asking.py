"""Asking a pit one thing, and waiting for its answer."""

import time
from contextlib import suppress
from queue import Empty, SimpleQueue

from arena.errors import LostPitError
from arena.network.address import Address
from arena.network.session import Session

ANSWER_S = 5.0
"""A running pit answers within this time."""
RETRY_S = 0.25


def ask(session: Session, address: Address, key: str, payload: bytes) -> bytes:
    """Return a pit's answer to a query; `LostPitError` if none comes within `ANSWER_S`.

    An unanswered query is sent again, since a pit that opens has its router before it answers queries.
    """
    answers: SimpleQueue[bytes] = SimpleQueue()
    end_s = time.monotonic() + ANSWER_S
    while (left_s := end_s - time.monotonic()) > 0:
        session.ask(key, payload, answers.put, left_s)
        with suppress(Empty):
            if answer := answers.get(timeout=left_s + RETRY_S):
                return answer
        time.sleep(RETRY_S)
    raise LostPitError(f"a router answers at {address.endpoint}, and no pit called {address.pit}")
