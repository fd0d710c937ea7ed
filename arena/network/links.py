"""The connections of a router: where there is hardly room for more, those that nobody vouches for are cut.

Zenoh cannot close a single session. But its sockets are this process's: a duplicate of one is shut down, and Zenoh takes that for
the other side's leaving. Nothing stands between, so no turn takes longer. It works for what runs over TCP; unixsock-stream/ gives
its peers no address, and quic/ has one socket for all.
"""

import ipaddress
import math
import os
import socket
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from heapq import heapify, heapreplace
from queue import SimpleQueue
from typing import NamedTuple

import zenoh
from zenoh.handlers import Callback

from arena.network.capacity import Capacity

_SWEEP_S, _COUNT_S = 0.1, 0.5
"""Between two looks at the sessions; and, while there is no crowd, at how many files there are, which takes longer."""
_FULL, _RELIEVED = 7 / 8, 3 / 4
"""Of the room for sessions: beyond the first, they are cut down to the second. Those pending are cut down to half."""
_DESCRIPTORS = "/dev/fd"
_IPV6_PREFIX = 64
"""What one customer is given."""

Peer = tuple[str, int]


class Kept(NamedTuple):
    """Sessions that somebody vouches for."""

    always: Collection[str] = ()
    longest: Collection[str] = ()
    """Cut when no others are left."""


class Links:
    """Keeps room for those who come.

    Parameters
    ----------
    session
        The router's.
    port
        Where it listens, by TCP.
    """

    def __init__(self, session: zenoh.Session, port: int, capacity: Capacity) -> None:
        self._port, self._capacity = port, capacity
        self._events: SimpleQueue[zenoh.LinkEvent] = SimpleQueue()
        self.sessions: dict[Peer, str] = {}
        """By connection, the oldest first."""
        self._pending: dict[Peer, None] = {}
        """Connections that have no session yet, the oldest first; as they were found last."""
        self._n_own_files = _count_files()
        """Files that are no connections, or more than there are."""
        self._next_sweep_s = self._next_count_s = -math.inf
        self._listener = session.info.declare_link_events_listener(Callback(self._events.put, indirect=False), history=True)

    def relieve(self, find_kept: Callable[[], Kept], now_s: float) -> int:
        """Cut what is too many, ten times a second at most; return how many were cut.

        The address with the most connections loses its oldest first: a crowd from one place keeps out nobody else.
        """
        if now_s < self._next_sweep_s:
            return 0
        self._next_sweep_s = now_s + _SWEEP_S
        self.take_events()
        is_full = len(self.sessions) > _FULL * self._capacity.sessions
        if not is_full and now_s < self._next_count_s:
            return 0
        n_files = _count_files()
        self._n_own_files = min(self._n_own_files, n_files - len(self.sessions))
        if not is_full and n_files - len(self.sessions) - self._n_own_files <= self._capacity.pending / 2:
            self._next_count_s = now_s + _COUNT_S
            return 0
        sockets = _find_sockets(self._port)
        self._n_own_files = n_files - len(sockets)
        self._pending = {peer: None for peer in (*self._pending, *sockets) if peer in sockets and peer not in self.sessions}
        cut = choose(self._pending, len(self._pending) - self._capacity.pending // 2)
        if is_full:
            cut += self._choose_sessions(find_kept())
        for peer in cut:
            _shut_down(sockets.get(peer, -1), peer)
        return len(cut)

    def _choose_sessions(self, kept: Kept) -> list[Peer]:
        n = len(self.sessions) - int(_RELIEVED * self._capacity.sessions)
        strangers = [
            peer for peer, session in self.sessions.items() if session not in kept.always and session not in kept.longest
        ]
        cut = choose(strangers, n)
        known = [peer for peer, session in self.sessions.items() if session in kept.longest and session not in kept.always]
        return cut + choose(known, n - len(cut))

    def take_events(self) -> None:
        """Note who came and who left."""
        for _ in range(self._events.qsize()):
            event = self._events.get()
            peer = read_peer(event.link.dst)
            if not peer[1]:
                continue  # a worker of the pit
            if event.kind == zenoh.SampleKind.DELETE:
                self.sessions.pop(peer, None)
            else:
                self.sessions[peer] = str(event.link.zid)


def choose(peers: Iterable[Peer], n: int) -> list[Peer]:
    """Return `n` peers, or all if there are fewer: always the oldest of the address that has most of those that are left.

    Parameters
    ----------
    peers
        The oldest first.
    """
    by_address: dict[str, deque[Peer]] = defaultdict(deque)
    for peer in peers:
        by_address[_address(peer[0])].append(peer)
    crowds = [(-len(crowd), address) for address, crowd in by_address.items()]
    heapify(crowds)
    chosen: list[Peer] = []
    while len(chosen) < n and crowds and crowds[0][0]:
        left, address = crowds[0]
        chosen.append(by_address[address].popleft())
        heapreplace(crowds, (left + 1, address))
    return chosen


def read_peer(locator: str) -> Peer:
    """Return host and port of a locator of Zenoh's, such as tcp/127.0.0.1:40000 or tls/[::1]:40000."""
    host, _, port = locator.partition("/")[2].partition("?")[0].rpartition(":")
    return host.strip("[]"), int(port) if port.isdecimal() else 0


def _address(host: str) -> str:
    """Return what the connections of one owner have in common."""
    try:
        ip = ipaddress.ip_address(host)
    except ValueError:
        return host
    if isinstance(ip, ipaddress.IPv4Address) or ip.ipv4_mapped:
        return host
    return str(ipaddress.ip_network((ip, _IPV6_PREFIX), strict=False))


def _count_files() -> int:
    return len(os.listdir(_DESCRIPTORS))  # noqa: PTH208  # a third of the time of pathlib's


def _find_sockets(port: int) -> dict[Peer, int]:
    """Return the descriptors of this process's connections to its own port, by their peers."""
    found: dict[Peer, int] = {}
    for name in os.listdir(_DESCRIPTORS):  # noqa: PTH208
        with suppress(OSError), _duplicate(int(name)) as one:
            if one.family in (socket.AF_INET, socket.AF_INET6) and one.getsockname()[1] == port:
                found[one.getpeername()[:2]] = int(name)
    return found


def _duplicate(descriptor: int) -> socket.socket:
    """Return a duplicate of a socket, which is ours whenever Zenoh may close its own; `OSError` if it is none."""
    duplicate = os.dup(descriptor)
    try:
        return socket.socket(fileno=duplicate)
    except OSError:
        os.close(duplicate)
        raise


def _shut_down(descriptor: int, peer: Peer) -> None:
    """End a connection, unless its descriptor has become another's meanwhile."""
    with suppress(OSError), _duplicate(descriptor) as one:
        if one.getpeername()[:2] == peer:
            one.shutdown(socket.SHUT_RDWR)
