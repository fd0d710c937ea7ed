"""The threads that Zenoh has in a process: one for sending, and one for all else, where nothing is passed on.

By its own choice it has six: one learns of a message that came, wakes a second, and that one a third, which has nothing to do. In
a match of two clients, whose threads all sleep between messages, that took a tenth of a turn. A router that passes on to workers
what seats say keeps Zenoh's own choice, for receiving and sending are all that it does.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

_ASKED_FOR = "ZENOH_RUNTIME"
_TOGETHER = "rx: (worker_threads: 1), app: (handover: rx), net: (handover: rx)"
"""Sending stays apart, for what comes from others must not wait for a peer that does not read."""
_ACCEPTING = "acc: (handover: rx)"


@contextmanager
def chosen_threads(*, is_encrypted: bool) -> Iterator[None]:
    """Choose for this process while its first session opens; whoever starts it may choose by the environment instead.

    Parameters
    ----------
    is_encrypted
        Whether sessions go by TLS. Who connects is met by another thread then, since a handshake takes it a millisecond.
    """
    if _ASKED_FOR in os.environ:
        yield
        return
    os.environ[_ASKED_FOR] = f"({', '.join((_TOGETHER,) if is_encrypted else (_TOGETHER, _ACCEPTING))})"
    try:
        yield
    finally:
        os.environ.pop(_ASKED_FOR, None)  # not for the processes that this one starts
