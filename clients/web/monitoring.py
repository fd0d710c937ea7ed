"""What the web server tells a monitor: of the pages that it serves, and whether it reaches its pit."""

import time

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from arena.metrics.definitions import PAGE_SECONDS, PAGES_OPEN, PIT_REACHABLE, Histogram, Reading
from arena.metrics.exposition import CONTENT_TYPE, expose
from clients.web.guard import App, Receive, Scope, Send
from clients.web.pit import PitClient

_BOUNDS_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


class WebMonitor:
    """The counts of one web server; the loop that serves the pages counts."""

    def __init__(self, pit: PitClient) -> None:
        self._pit = pit
        self._pages = Histogram(_BOUNDS_S)
        self._n_open = 0

    async def healthz(self, _: Request) -> Response:
        """Answer that the server serves; a pit that is away is no fault of its own, and comes back."""
        return PlainTextResponse("well\n")

    async def metrics(self, _: Request) -> Response:
        """Answer as Prometheus scrapes it."""
        readings = [
            Reading(PIT_REACHABLE, float(self._pit.lobby is not None)),
            Reading(PAGES_OPEN, self._n_open),
            Reading(PAGE_SECONDS, self._pages),
        ]
        return Response(expose(readings), headers={"content-type": CONTENT_TYPE})

    async def count(self, app: App, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection, and count it."""
        begun_s, is_page = time.monotonic(), scope["type"] == "websocket"
        self._n_open += is_page
        try:
            await app(scope, receive, send)
        finally:
            self._n_open -= is_page
            if scope["type"] == "http":
                self._pages.add([time.monotonic() - begun_s])


class Counted:
    """An application whose connections are counted. Plain ASGI."""

    def __init__(self, app: App, monitor: WebMonitor) -> None:
        self._app, self._monitor = app, monitor

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        await self._monitor.count(self._app, scope, receive, send)
