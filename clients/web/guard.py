"""What stands before every request: who may ask, and what a browser may do with the answer. Plain ASGI.

A page on the loopback is within reach of every page that its user opens elsewhere. So the Host header must name this server (a
stranger's name that was made to point here does not), only a page of this server may open a WebSocket, send something along or
load parts, and a browser is told to load nothing from anywhere else.
"""

from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping, Sequence
from ipaddress import IPv6Address
from typing import Any
from urllib.parse import urlsplit

from arena.errors import InputError

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
EVERYWHERE = ("0.0.0.0", "::")
_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-cache",
}
EMBEDDED = "/embed/"
"""What stands below may be shown in a frame on pages of others: it can be looked at, and does nothing."""
_EMBEDDED_HEADERS = HEADERS | {"content-security-policy": _POLICY.replace("frame-ancestors 'none'", "frame-ancestors *")}
_RAW_HEADERS = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
_RAW_EMBEDDED_HEADERS = [(name.encode(), value.encode()) for name, value in _EMBEDDED_HEADERS.items()]
_READING = ("GET", "HEAD")
_NOT_OURS = b"only pages of this server may load its parts, or send it something\n"
_REFUSED = b"this server is called otherwise; arena web --name says by which names it may be called\n"


def list_names(host: str, names: Sequence[str], prefix: str = "--") -> tuple[str, ...]:
    """Return by which names a server may be called that listens at a host; `InputError` if nobody says, and nothing tells.

    Parameters
    ----------
    host
        Where it listens.
    names
        Further names, the one to be shown first.
    prefix
        Of the options `host` and `name`, for the sentence.
    """
    if host in EVERYWHERE:
        if not names:
            raise InputError(
                f"{prefix}host {host} listens everywhere; say with {prefix}name by which name or number browsers reach it"
            )
        return (*LOOPBACK, *map(_write_host, names))
    return (*LOOPBACK, *map(_write_host, (*names, host)))


def _write_host(name: str) -> str:
    """Return a name or a number as browsers write it."""
    try:
        return f"[{IPv6Address(name.strip('[]'))}]"
    except ValueError:
        return name


class Guard:
    """Lets in what comes by one of the server's names, and WebSockets and what is sent along only from its own pages."""

    def __init__(self, app: App, names: Iterable[str]) -> None:
        self._app = app
        self._names = frozenset(name.lower() for name in names)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        host = headers.get("host", "").lower()
        is_known = _without_port(host) in self._names
        if scope["type"] == "websocket":
            if is_known and is_same_origin(headers.get("origin", ""), host):
                await self._app(scope, receive, send)
            else:
                await receive()
                await send({"type": "websocket.close", "code": 1008})  # before it was accepted: the browser gets a 403
            return
        if not is_known:
            await _refuse(send, 421, _REFUSED)
            return
        is_sent_along = scope["method"] not in _READING
        if _is_part_of_a_strangers_page(headers) or (is_sent_along and not is_same_origin(headers.get("origin", ""), host)):
            await _refuse(send, 403, _NOT_OURS)
            return

        own = _RAW_EMBEDDED_HEADERS if scope["path"].startswith(EMBEDDED) else _RAW_HEADERS

        async def send_guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *own]
            await send(message)

        await self._app(scope, receive, send_guarded)


async def _refuse(send: Send, status: int, sentence: bytes) -> None:
    await send({"type": "http.response.start", "status": status, "headers": _RAW_HEADERS})
    await send({"type": "http.response.body", "body": sentence})


def _is_part_of_a_strangers_page(headers: Mapping[str, str]) -> bool:
    """Whether a browser asks for it as an image, a script or data of a page from elsewhere, and not to open it."""
    return headers.get("sec-fetch-site") in ("cross-site", "same-site") and headers.get("sec-fetch-mode") != "navigate"


def is_same_origin(origin: str, host: str) -> bool:
    """Whether a page's origin is this server, by the name and port under which it was asked; in lower case."""
    try:
        parts = urlsplit(origin.lower())
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(host) and parts.netloc == host and not parts.path


def _without_port(host: str) -> str:
    name, colon, port = host.rpartition(":")
    return name if colon and port.isdecimal() else host
