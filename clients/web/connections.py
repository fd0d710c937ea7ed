"""HTTP/1.1 as uvicorn speaks it, but for one thing: a request that is half sent does not hold its connection for ever.

uvicorn's `timeout_keep_alive` counts only while nothing at all was sent; the first letter of a request stops it.
"""

import asyncio
from typing import ClassVar

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 500
"""Whoever comes beyond them is told to come later; a process may commonly have 1,024 files open."""
MOST_MESSAGE_BYTES = 1 << 16
"""More than a page ever says at once."""


class ImpatientProtocol(H11Protocol):
    """Closes a connection whose request is not whole in time, however slowly it goes on coming."""

    PATIENCE_S: ClassVar[float] = 10.0
    FILE_PATIENCE_S: ClassVar[float] = 70.0
    """With a file that somebody waits for: longer than `clients.web.recordings` does, which says so."""
    _waiting: asyncio.TimerHandle | None = None
    _patience_s: float | None = None
    """For which it waits."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as in the class above
        """Wait for a first request."""
        super().connection_made(transport)
        self._wait_or_not()

    def data_received(self, data: bytes) -> None:
        """Wait for the rest of a request, or no longer."""
        super().data_received(data)
        self._wait_or_not()

    def on_response_complete(self) -> None:
        """Wait for the rest of the next request, of which a part may be there."""
        super().on_response_complete()
        if not self.transport.is_closing():
            self._wait_or_not()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        super().connection_lost(exc)
        self._stop()

    def _wait_or_not(self) -> None:
        patience_s = self._choose_patience_s()
        if patience_s == self._patience_s:
            return
        self._stop()
        if patience_s is not None:
            self._waiting, self._patience_s = self.loop.call_later(patience_s, self.transport.close), patience_s

    def _choose_patience_s(self) -> float | None:
        """Return how long the rest of a request may take, from when its first part or its head had come; None if it is whole."""
        if self.conn.their_state is h11.SEND_BODY and self.conn.our_state is h11.SEND_RESPONSE:
            return self.FILE_PATIENCE_S
        return self.PATIENCE_S if self.conn.their_state in (h11.IDLE, h11.SEND_BODY) else None

    def _stop(self) -> None:
        if self._waiting is not None:
            self._waiting.cancel()
        self._waiting = self._patience_s = None
