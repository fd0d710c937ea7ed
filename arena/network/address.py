"""Where a pit is: `arena://HOST:PORT/PIT#PUBLICKEY`, as `arena serve` prints it and `arena join` takes it.

By TLS it is `arena+tls://HOST:PORT/PIT`, by QUIC, WebSockets or UDP likewise, and by a Unix socket `arena+unix:///PATH/PIT`.
"""

import os
import re
import socket
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import SplitResult, urlsplit

from arena.errors import InputError
from arena.protocol.identity import from_text
from arena.protocol.topics import check_chunk

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
DEFAULT_PIT = "pit"
_PROTOCOLS = {
    "arena": "tcp",
    "arena+tls": "tls",
    "arena+quic": "quic",
    "arena+unix": "unixsock-stream",
    "arena+ws": "ws",
    "arena+udp": "udp",
}
"""Of endpoints, as Zenoh calls them, by the schemes of addresses."""
_MOST_SOCKET_BYTES = 107
"""Of the path of a Unix socket, by the system."""
_LOOPBACK = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}
"""Where this machine reaches a pit that listens everywhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """A pit's address."""

    endpoint: str = DEFAULT_ENDPOINT
    """As Zenoh writes it: tcp/HOST:PORT."""
    pit: str = DEFAULT_PIT
    fingerprint: str = ""
    """The pit's public key; without it, whoever answers first is believed."""

    def __str__(self) -> str:
        protocol, _, where = self.endpoint.partition("/")
        scheme = next((scheme for scheme, known in _PROTOCOLS.items() if known == protocol), "arena")
        return f"{scheme}://{where}/{self.pit}{'#' if self.fingerprint else ''}{self.fingerprint}"

    def from_here(self) -> "Address":
        """Return how this machine reaches its own pit: one that listens everywhere is also on loopback."""
        protocol, _, where = self.endpoint.partition("/")
        host, _, port = where.rpartition(":")
        return replace(self, endpoint=f"{protocol}/{_LOOPBACK[host]}:{port}") if host in _LOOPBACK else self


def parse_address(text: str) -> Address:
    """Read an address, or a bare Zenoh endpoint such as tcp/127.0.0.1:7447."""
    scheme, colon, _ = text.partition("://")
    if not colon or scheme not in _PROTOCOLS:
        protocol, slash, rest = text.partition("/")
        if not slash or not rest or protocol not in _PROTOCOLS.values():
            raise InputError(f"{text!r} is no address; write arena://HOST:PORT/PIT or tcp/HOST:PORT")
        return Address(endpoint=text)
    try:
        parts = urlsplit(text)
        if scheme == "arena+unix":
            return _parse_socket(text, parts)
        port = parts.port
    except ValueError as error:
        raise InputError(f"{text!r} has a host or a port that is none") from error
    if not parts.hostname or port is None:
        raise InputError(f"{text!r} lacks a host or a port; write {scheme}://HOST:PORT/PIT")
    if parts.fragment:
        from_text(parts.fragment)
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    return Address(
        endpoint=f"{_PROTOCOLS[scheme]}/{host}:{port}",
        pit=check_chunk("the pit's name", parts.path.strip("/") or DEFAULT_PIT),
        fingerprint=parts.fragment,
    )


def _parse_socket(text: str, parts: SplitResult) -> Address:
    path, _, pit = parts.path.rpartition("/")
    if not path or parts.netloc:
        raise InputError(f"{text!r} lacks the path of a socket; write arena+unix:///PATH/PIT")
    if parts.fragment:
        from_text(parts.fragment)
    return Address(endpoint=f"unixsock-stream/{path}", pit=check_chunk("the pit's name", pit), fingerprint=parts.fragment)


def is_encrypted(endpoint: str) -> bool:
    """Whether what goes over an endpoint goes by TLS."""
    return endpoint.startswith(("tls/", "quic/"))


def check_endpoint(endpoint: str) -> None:
    """Refuse what is no endpoint, and the path of a Unix socket that the system does not take; `InputError` says what to do."""
    protocol, _, path = endpoint.partition("/")
    if protocol not in _PROTOCOLS.values():
        raise InputError(f"{endpoint!r} is no endpoint; write tcp/HOST:PORT")
    if protocol != "unixsock-stream":
        if not re.fullmatch(r"[^/]+:\d+", path.partition("?")[0].partition("#")[0]):
            raise InputError(f"{endpoint!r} lacks a host or a port; write {protocol}/HOST:PORT")
        return
    n_bytes = len(os.fsencode(path))
    if n_bytes > _MOST_SOCKET_BYTES:
        raise InputError(
            f"the path of the socket {path} has {n_bytes} bytes, and the system takes {_MOST_SOCKET_BYTES}; choose a shorter one"
        )
    if not path.startswith("/"):
        raise InputError(f"the socket {path!r} needs a path from the root, as in unixsock-stream//tmp/pit.sock")
    if not Path(path).parent.is_dir():
        raise InputError(f"the folder of the socket {path} does not exist; make it first")


def free_port() -> int:
    """Return a TCP port of loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
