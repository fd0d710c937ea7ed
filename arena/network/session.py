"""Zenoh sessions: publishers, subscribers, queries and presence, with callbacks that only pass bytes on.

No other module of ours imports `zenoh`. Why each setting is what it is stands beside it, as measured on 1.10.
"""

import json
from collections.abc import Callable, Iterable
from contextlib import nullcontext, suppress
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Any

import zenoh
from zenoh.handlers import Callback, RingChannel

from arena.errors import InputError, LostPitError
from arena.network.access import WORKERS_PROTOCOL, Certificate, access_rules, check_authority, check_certificate
from arena.network.address import check_endpoint, is_encrypted
from arena.network.capacity import Capacity, find_capacity
from arena.network.links import Kept, Links, read_peer
from arena.network.threads import chosen_threads
from arena.protocol.codec import MOST_BYTES

Put = Callable[[bytes], None]
Sample = zenoh.Sample
"""A message of a subscription; `read_key` and `read_payload` take it apart, on the thread that handles it."""
_OPEN_TIMEOUT_MS = 6_000
_ACCEPT_TIMEOUT_MS = 3_000
"""Who connects to a router says who it is within this time."""
_WITHOUT_PEERS = ("unixsock-stream/", "quic/", "udp/")
"""Where a router cannot tell one connection from another."""
_MOST_WIRE_BYTES = MOST_BYTES + 4_000
"""Of a message and its frame, put together from fragments; a longer one is dropped, and its sender stays connected."""
_MOST_NAME_BYTES = 32
"""Of a session's name in Zenoh."""
_COMMON = {
    # Nobody meets by accident: clients connect to the pit that they name. A router would wait half a second for others.
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,
    # Batches in the queue of each peer: the most that Zenoh allows, so that a peer that waits for a busy core is not cut off.
    "transport/link/tx/queue/size/data": 16,
    # By shared memory, 10 MB from the same machine got past the bound on the size of messages.
    "transport/shared_memory/enabled": False,
    # There a router would show who is connected.
    "adminspace/enabled": False,
}
_WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
"""How long, in microseconds, a peer that does not read holds `put` before it is cut off."""
_ROUTER_WAITS_US, _WITH_WORKERS_US, _CLIENT_WAITS_US = 50_000, 250_000, 5_000_000
"""A router serves others meanwhile. A client has nobody else to talk to, and a busy router is no reason to leave."""
_DROP = "transport/link/tx/queue/congestion_control/drop/"


class Query:
    """A query that waits for its answer, which may come later and from any thread."""

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self._query, self._key = query, key
        self.key = str(query.key_expr)
        """The key that was asked for: where an expression is answered, one of its keys, or an expression too."""
        self.payload = _bytes(query.payload) if query.payload is not None else b""
        self.sender = _read_sender(query.attachment)
        """The session that it says to come from; empty if it does not say."""

    def answer(self, payload: bytes) -> None:
        """Send the one answer."""
        with suppress(zenoh.ZError):  # the other side may be gone
            self._query.reply(self.key if "*" in self._key else self._key, payload, express=True)
        self._query.drop()

    def drop(self) -> None:
        """Leave the query without an answer."""
        self._query.drop()


def _read_sender(attachment: zenoh.ZBytes | None) -> str:
    if attachment is None or len(attachment) > _MOST_NAME_BYTES:
        return ""
    return attachment.to_bytes().decode(errors="replace")


OnQuery = Callable[[Query], None]


class Session:
    """One Zenoh session, closed by `with`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._routers = self._find_routers()
        self.name = str(session.info.zid())
        """What it is called at the other end, too."""
        self.links: Links | None = None
        """Of a router whose connections can be told apart."""
        self._tokens: list[zenoh.LivelinessToken] = []  # held, since Zenoh withdraws what is garbage

    def limit_links(self, port: int, capacity: Capacity) -> None:
        """Keep room for those who come, as a router that listens at a TCP port; `relieve` does it."""
        self.links = Links(self._session, port, capacity)

    def relieve(self, find_kept: Callable[[], Kept], now_s: float) -> int:
        """Cut connections that nobody vouches for, if there is hardly room for more; return how many."""
        return 0 if self.links is None else self.links.relieve(find_kept, now_s)

    def _find_routers(self) -> list[str]:
        return [str(router) for router in self._session.info.routers_zid()]

    def is_connected(self) -> bool:
        """Whether the router that this client connected to is still there, and no other has taken its place."""
        routers = self._find_routers()
        self._routers = self._routers or routers  # one that only just opened may not know its router yet
        return bool(routers) and routers == self._routers

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._session.close()

    def publisher(self, key: str) -> tuple[Put, Callable[[], None]]:
        """Return what publishes on `key`, and what undeclares it."""
        publisher = self._declare_publisher(key)
        return publisher.put, publisher.undeclare

    def broadcast(self, key: str) -> "Broadcast":
        """Return a publisher on `key` that knows whether it has subscribers, and waits for none: who does not read misses it."""
        return Broadcast(self._declare_publisher(key, zenoh.CongestionControl.DROP))

    def _declare_publisher(
        self, key: str, congestion: zenoh.CongestionControl = zenoh.CongestionControl.BLOCK
    ) -> zenoh.Publisher:
        # BLOCK: the default, DROP, lost turns under load. Express: a turn is not kept back to fill a batch.
        return self._session.declare_publisher(key, congestion_control=congestion, express=True)

    def spread(self, key: str, payload: bytes) -> None:
        """Publish once on a key that has no publisher, to whoever reads; nobody is waited for."""
        self._session.put(key, payload, congestion_control=zenoh.CongestionControl.DROP, express=True)

    def subscribe(self, key: str, on_sample: Callable[[Sample], None]) -> Callable[[], None]:
        """Call `on_sample` with each sample, on a thread of Zenoh's, so it may only enqueue; return what unsubscribes."""
        return self._session.declare_subscriber(key, Callback(on_sample, indirect=False)).undeclare

    def collect(self, key: str, most: int) -> "Collector":
        """Subscribe with a queue outside Python, where no thread fights for the interpreter; beyond `most`, the oldest go."""
        return Collector(self._session.declare_subscriber(key, RingChannel(most)))

    def waker(self, key: str) -> tuple[Put, Callable[[], None]]:
        """Return what publishes on `key` to this session alone, to wake a `Collector`, and what undeclares it."""
        publisher = self._session.declare_publisher(key, allowed_destination=zenoh.Locality.SESSION_LOCAL)
        return publisher.put, publisher.undeclare

    def heartbeat(self, key: str, period_s: float) -> Callable[[], None]:
        """Publish an empty sample to this session alone every `period_s`, to wake a `Collector`; return what stops it."""
        return self._beat([self._session.declare_publisher(key, allowed_destination=zenoh.Locality.SESSION_LOCAL)], period_s)

    def beat(self, keys: Iterable[str], period_s: float) -> Callable[[], None]:
        """Publish an empty sample on each key every `period_s`, for others to know that this session is served."""
        drop = zenoh.CongestionControl.DROP
        return self._beat([self._session.declare_publisher(key, congestion_control=drop, express=True) for key in keys], period_s)

    def _beat(self, publishers: Iterable[zenoh.Publisher], period_s: float) -> Callable[[], None]:
        stopped = Event()

        def run() -> None:
            while not stopped.wait(period_s):
                for publisher in publishers:
                    with suppress(zenoh.ZError):  # the session is closing
                        publisher.put(b"")

        def end() -> None:
            stopped.set()
            thread.join()  # a thread within Zenoh when the interpreter ends takes the process down

        thread = Thread(target=run, name="heartbeat", daemon=True)
        thread.start()
        return end

    def answer(self, key: str, on_query: OnQuery) -> Callable[[], None]:
        """Call `on_query` with every query of `key`; return what undeclares it."""
        received: Any = Callback(lambda query: on_query(Query(query, key)), indirect=False)
        return self._session.declare_queryable(key, received).undeclare

    def ask(self, key: str, payload: bytes, on_answer: Callable[[bytes], None], timeout_s: float) -> None:
        """Send a query, and call `on_answer` with the answer; with b"" if nobody answers in time."""
        answers = []

        def replied(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                answers.append(_bytes(reply.ok.payload))
                on_answer(answers[0])

        def ended() -> None:
            if not answers:
                on_answer(b"")

        self._session.get(key, Callback(replied, ended, indirect=False), payload=payload, timeout=timeout_s, attachment=self.name)

    def declare_presence(self, key: str) -> None:
        """Show that this process is there, until the session ends."""
        self._tokens.append(self._session.liveliness().declare_token(key))

    def watch_presence(self, key: str, on_change: Callable[[str, bool], None]) -> Callable[[], None]:
        """Call `on_change` with the key of each process that comes (True), those that are there first, or goes (False)."""

        def changed(sample: zenoh.Sample) -> None:
            on_change(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        return self._session.liveliness().declare_subscriber(key, Callback(changed, indirect=False), history=True).undeclare


class Broadcast:
    """A publisher that often has no subscribers, so that nothing need be made to be sent."""

    def __init__(self, publisher: zenoh.Publisher) -> None:
        self.put: Put = publisher.put
        self.end: Callable[[], None] = publisher.undeclare
        self.has_subscribers: bool = False
        self._listener = publisher.declare_matching_listener(Callback(self._on_change, indirect=False))
        self.has_subscribers = self.has_subscribers or publisher.matching_status.matching  # type: ignore[attr-defined]  # Zenoh types it as bool

    def _on_change(self, status: zenoh.MatchingStatus) -> None:
        self.has_subscribers = status.matching


class Collector:
    """The samples of a subscription in a queue outside Python, for one thread to read."""

    def __init__(self, subscriber: Any) -> None:
        self.wait: Callable[[], Sample] = subscriber.recv
        """Return the next sample, however long it takes."""
        self.take: Callable[[], Sample | None] = subscriber.try_recv
        """Return the next sample if there is one, or None."""
        self.end: Callable[[], None] = subscriber.undeclare


def read_key(sample: Sample) -> str:
    """Return the key of a sample."""
    return str(sample.key_expr)


def is_heartbeat(sample: Sample) -> bool:
    """Whether a sample is of `Session.heartbeat`, or as empty as one."""
    return len(sample.payload) == 0


def read_payload(sample: Sample) -> bytes:
    """Return the payload of a sample, or nothing of one that is longer than any message."""
    return _bytes(sample.payload)


def _bytes(payload: zenoh.ZBytes) -> bytes:
    """Return the payload; nothing of one that is longer than any message, so that no queue is filled with it."""
    return payload.to_bytes() if len(payload) <= MOST_BYTES else b""


def open_router(
    endpoint: str, pit: str, certificate: Certificate | None = None, *, for_players: bool = True, workers_endpoint: str = ""
) -> Session:
    """Listen at an endpoint such as tcp/127.0.0.1:7447, as the router that clients connect to.

    Parameters
    ----------
    endpoint
        One that begins with tls/ or quic/ needs a certificate, and no other takes one.
    pit, for_players
        Clients may do what a player of this pit does, or else a spectator, no more. The session that is returned may do all.
    workers_endpoint
        Where workers of the pit connect, who may do anything as well; by `WORKERS_PROTOCOL`, in a folder of the pit's own.
    """
    check_endpoint(endpoint)
    if workers_endpoint and endpoint.startswith(WORKERS_PROTOCOL):
        raise InputError(f"workers are known by {WORKERS_PROTOCOL}/, where nobody else may connect; listen at tcp/ or tls/")
    capacity = find_capacity()
    settings: dict[str, Any] = {
        "listen/endpoints": [endpoint, workers_endpoint] if workers_endpoint else [endpoint],
        # All that is said to a worker goes over its one link: a moment in which that waits for a core must not cut it off.
        _WAIT_BEFORE_CLOSE: _WITH_WORKERS_US if workers_endpoint else _ROUTER_WAITS_US,
        # By default a millisecond for each spectator who does not read, at every turn.
        f"{_DROP}wait_before_drop": 0,
        f"{_DROP}max_wait_before_drop_fragments": 0,
        "transport/unicast/max_sessions": capacity.sessions,
        "transport/unicast/accept_pending": capacity.pending,
        "transport/unicast/accept_timeout": _ACCEPT_TIMEOUT_MS,
        "transport/link/rx/max_message_size": _MOST_WIRE_BYTES,
        "access_control": access_rules(pit, for_players=for_players, has_workers=bool(workers_endpoint)),
    }
    if is_encrypted(endpoint) != (certificate is not None):
        raise InputError(f"cannot listen at {endpoint}: tls/ needs a certificate and its key, and tcp/ takes none")
    if certificate is not None:
        check_certificate(certificate)
        settings["transport/link/tls/listen_certificate"] = str(certificate.certificate)
        settings["transport/link/tls/listen_private_key"] = str(certificate.key)
    with nullcontext() if workers_endpoint else chosen_threads(is_encrypted=certificate is not None):
        router = _open("router", settings, f"cannot listen at {endpoint}")
    if not endpoint.startswith(_WITHOUT_PEERS):
        router.limit_links(read_peer(endpoint)[1], capacity)
    return router


def open_client(endpoint: str, authority: Path | None = None) -> Session:
    """Connect to the router at an endpoint.

    Parameters
    ----------
    authority
        For tls/ and quic/: a PEM file of the certificates to trust, such as the pit's own; without it, those that the web trusts.
    """
    check_endpoint(endpoint)
    settings: dict[str, Any] = {
        _WAIT_BEFORE_CLOSE: _CLIENT_WAITS_US,
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": _OPEN_TIMEOUT_MS,
        "connect/exit_on_failure": True,
    }
    if authority is not None:
        if not is_encrypted(endpoint):
            raise InputError(f"{endpoint} is not encrypted, so nothing there can be checked with {authority}")
        check_authority(authority)
        settings["transport/link/tls/root_ca_certificate"] = str(authority)
    stranger = " with a certificate that we trust" if is_encrypted(endpoint) else ""
    with chosen_threads(is_encrypted=is_encrypted(endpoint)):
        return _open("client", settings, f"no pit answers at {endpoint}{stranger}")


def _open(mode: str, settings: dict[str, Any], failure: str) -> Session:
    config = zenoh.Config()
    try:
        for key, value in {"mode": mode, **_COMMON, **settings}.items():
            config.insert_json5(key, json.dumps(value))
    except zenoh.ZError as error:
        raise InputError(f"{failure}: {error}") from error
    zenoh.init_log_from_env_or("off")  # RUST_LOG=error shows what Zenoh complains of
    try:
        return Session(zenoh.open(config))
    except zenoh.ZError as error:
        raise (InputError if mode == "router" else LostPitError)(f"{failure}: {_reason(str(error))}") from error


def _reason(text: str) -> str:
    """Return the part of Zenoh's error that a person can use."""
    for known, said in (
        ("Address already in use", "the port is in use"),
        ("Unable to connect", f"nobody let us in within {_OPEN_TIMEOUT_MS / 1000:.0f} s"),
        ("Permission denied", "permission denied"),
    ):
        if known in text:
            return said
    return text.partition(" at /")[0].splitlines()[0]
