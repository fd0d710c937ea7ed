"""With real sessions over loopback."""

import ipaddress
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from arena.errors import InputError, LostPitError
from arena.game.types import Team
from arena.network.access import WORKERS_PROTOCOL, Certificate
from arena.network.address import free_port
from arena.network.session import Broadcast, Session, open_client, open_router, read_key, read_payload
from arena.protocol import topics

WAIT_S = 10.0


@pytest.fixture
def ends() -> Iterator[tuple[Session, Session]]:
    """A router, and a client of it."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_router(endpoint, "p") as router, open_client(endpoint) as client:
        yield router, client


def await_subscribers(broadcast: Broadcast, expected: bool) -> None:
    tick = Event()
    for _ in range(int(WAIT_S / 0.01)):
        if broadcast.has_subscribers == expected:
            return
        tick.wait(0.01)
    pytest.fail(f"has_subscribers stays {broadcast.has_subscribers}")


def test_a_broadcast_knows_who_comes_and_goes(ends: tuple[Session, Session]) -> None:
    router, client = ends
    broadcast = router.broadcast("arena/p/match/m/public")
    assert not broadcast.has_subscribers
    heard: SimpleQueue[bytes] = SimpleQueue()

    leave = client.subscribe("arena/p/match/*/public", lambda sample: heard.put(read_payload(sample)))
    await_subscribers(broadcast, True)
    broadcast.put(b"facts")

    assert heard.get(timeout=WAIT_S) == b"facts"
    leave()
    await_subscribers(broadcast, False)
    broadcast.end()


def test_a_broadcast_that_begins_late_knows_who_is_there(ends: tuple[Session, Session]) -> None:
    router, client = ends
    first = router.broadcast("arena/p/match/m/public")
    client.subscribe("arena/p/match/*/public", lambda sample: None)
    await_subscribers(first, True)

    assert router.broadcast("arena/p/match/n/public").has_subscribers


class Stall:
    """Stands between a client and its router; while `reads` is not set, nothing of the client's is passed on.

    While `listens` is not set, nothing is passed on to the client.
    """

    def __init__(self, port: int) -> None:
        self.reads, self.listens = threading.Event(), threading.Event()
        self.reads.set()
        self.listens.set()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._router = socket.create_connection(("127.0.0.1", port))
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        with self._listening, self._router, self._listening.accept()[0] as client:
            back = threading.Thread(target=self._pass_on, args=(self._router, client))
            back.start()
            self._pass_on(client, self._router)
            back.join()

    def _pass_on(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := one.recv(1 << 16):
                (self.listens if one is self._router else self.reads).wait()
                other.sendall(data)
        with suppress(OSError):
            other.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.reads.set()
        self.listens.set()
        self._thread.join()


def test_a_client_waits_for_a_busy_router_instead_of_leaving_it() -> None:
    stall_s, n_messages, message = 0.5, 400, bytes(60_000)  # more than all buffers on the way hold
    port = free_port()
    with open_router(f"tcp/127.0.0.1:{port}", "p") as router, closing(Stall(port)) as stall:
        came = threading.Semaphore(0)
        router.subscribe("arena/p/lane/*/*/action", lambda sample: came.release())
        with open_client(f"tcp/127.0.0.1:{stall.port}") as client:
            await_subscribers(client.broadcast("arena/p/lane/7/blue/action"), True)
            put, _ = client.publisher("arena/p/lane/7/blue/action")
            stall.reads.clear()
            sender = threading.Thread(target=lambda: [put(message) for _ in range(n_messages)], daemon=True)
            sender.start()
            sender.join(stall_s)
            assert sender.is_alive(), "the client left, or nothing held it up"
            stall.reads.set()

            assert all(came.acquire(timeout=WAIT_S) for _ in range(n_messages))
            assert client.is_connected()


def test_a_spectator_who_stops_reading_misses_what_was_said_and_nobody_waits_for_it() -> None:
    n_messages, message = 400, bytes(60_000)  # more than all buffers on the way hold
    port = free_port()
    with open_router(f"tcp/127.0.0.1:{port}", "p") as router, closing(Stall(port)) as stall:
        heard: SimpleQueue[bytes] = SimpleQueue()
        broadcast = router.broadcast("arena/p/match/m/public")
        with open_client(f"tcp/127.0.0.1:{stall.port}") as client:
            client.subscribe("arena/p/match/*/public", lambda sample: heard.put(read_payload(sample)))
            await_subscribers(broadcast, True)
            stall.listens.clear()
            for _ in range(n_messages):
                broadcast.put(message)
            stall.listens.set()
            said = "a pit that waits has cut it off, and this is not heard"
            for _ in range(int(WAIT_S / 0.01)):
                broadcast.put(said.encode())
                with suppress(Empty):
                    if heard.get(timeout=0.01) == said.encode():
                        break
            else:
                pytest.fail(said)

            assert heard.qsize() < n_messages
            assert client.is_connected()


def make_certificate(folder: Path, name: str, *, ca: bool = False) -> Certificate:
    """Write a self-signed certificate of 127.0.0.1, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    names = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
    builder = x509.CertificateBuilder(subject, subject, key.public_key(), x509.random_serial_number())
    now = datetime.now(UTC)
    builder = builder.not_valid_before(now - timedelta(days=1)).not_valid_after(now + timedelta(days=1))
    builder = builder.add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
    certificate = builder.add_extension(names, critical=False).sign(key, hashes.SHA256())
    written = Certificate(certificate=folder / f"{name}.crt", key=folder / f"{name}.key")
    written.certificate.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    form = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    written.key.write_bytes(key.private_bytes(*form))
    return written


def test_tls_carries_messages_to_those_who_trust_the_certificate_only(tmp_path: Path) -> None:
    endpoint = f"tls/127.0.0.1:{free_port()}"
    certificate, other = make_certificate(tmp_path, "pit"), make_certificate(tmp_path, "other")
    with open_router(endpoint, "p", certificate) as router:
        for ca in (other.certificate, None):
            with pytest.raises(LostPitError, match="with a certificate that we trust"):
                open_client(endpoint, ca)

        heard: SimpleQueue[bytes] = SimpleQueue()
        router.subscribe("arena/p/lane/*/*/action", lambda sample: heard.put(read_payload(sample)))
        with open_client(endpoint, certificate.certificate) as client:
            client.publisher("arena/p/lane/7/blue/action")[0](b"stay")

            assert heard.get(timeout=WAIT_S) == b"stay"


@pytest.mark.parametrize(
    ("certificate", "key", "said"),
    [
        ("absent", "pit.key", "cannot read .*absent: No such file"),
        ("pit.crt", "absent", "cannot read .*absent: No such file"),
        ("pit.crt", ".", "cannot read .*: Is a directory"),
        ("junk", "pit.key", "must be PEM files"),
        ("pit.crt", "junk", "must be PEM files"),
        ("pit.key", "pit.crt", "must be PEM files"),
        ("pit.crt", "other.key", "belongs to another certificate"),
        ("pit.crt", "locked.key", "the key is locked by a password"),
        ("trusted.crt", "pit.key", "trusted.crt cannot be used: .*PEM"),
    ],
)
def test_a_router_says_what_is_wrong_with_a_certificate(tmp_path: Path, certificate: str, key: str, said: str) -> None:
    make_certificate(tmp_path, "pit")
    make_certificate(tmp_path, "other")
    (tmp_path / "junk").write_text("junk")
    text = (tmp_path / "pit.crt").read_text()
    (tmp_path / "trusted.crt").write_text(text.replace(" CERTIFICATE", " TRUSTED CERTIFICATE"))  # as openssl x509 -trustout
    locked = serialization.load_pem_private_key((tmp_path / "pit.key").read_bytes(), None).private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.BestAvailableEncryption(b"word")
    )
    (tmp_path / "locked.key").write_bytes(locked)
    given = Certificate(certificate=tmp_path / certificate, key=tmp_path / key)

    with pytest.raises(InputError, match=said):
        open_router(f"tls/127.0.0.1:{free_port()}", "p", given)


def test_a_certificate_that_no_client_would_take_is_refused(tmp_path: Path) -> None:
    """As `openssl req -x509` makes it, unless it is told otherwise."""
    certificate = make_certificate(tmp_path, "pit", ca=True)

    with pytest.raises(InputError, match="CA:FALSE, as by openssl"):
        open_router(f"tls/127.0.0.1:{free_port()}", "p", certificate)


def test_tls_and_a_certificate_go_together(tmp_path: Path) -> None:
    certificate = make_certificate(tmp_path, "pit")

    with pytest.raises(InputError, match="tls/ needs a certificate"):
        open_router(f"tls/127.0.0.1:{free_port()}", "p")
    with pytest.raises(InputError, match="tcp/ takes none"):
        open_router(f"tcp/127.0.0.1:{free_port()}", "p", certificate)
    with pytest.raises(InputError, match="is not encrypted"):
        open_client(f"tcp/127.0.0.1:{free_port()}", certificate.certificate)


@pytest.mark.parametrize(("ca", "said"), [("absent", "cannot read"), ("pit.key", "holds no certificate")])
def test_a_client_says_what_is_wrong_with_the_certificates_it_trusts(tmp_path: Path, ca: str, said: str) -> None:
    make_certificate(tmp_path, "pit")

    with pytest.raises(InputError, match=said):
        open_client(f"tls/127.0.0.1:{free_port()}", tmp_path / ca)


def test_a_worker_hears_its_own_lanes_alone_and_speaks_to_seats(tmp_path: Path) -> None:
    endpoint, workers = f"tcp/127.0.0.1:{free_port()}", f"{WORKERS_PROTOCOL}/{tmp_path}/w"
    own, others = (topics.action("p", topics.lanes_of_worker(worker).start, Team.RED) for worker in (1, 2))
    shown = topics.observation("p", topics.lanes_of_worker(1).start, Team.RED)
    with open_router(endpoint, "p", workers_endpoint=workers), open_client(workers) as worker, open_client(endpoint) as client:
        heard, seen = worker.collect(topics.actions_of_worker("p", 1), 8), client.collect(shown, 8)
        to_own, to_others, back = client.broadcast(own), client.broadcast(others), worker.broadcast(shown)
        for broadcast in (to_own, back):
            await_subscribers(broadcast, expected=True)
        assert not to_others.has_subscribers

        to_own.put(b"orders")
        back.put(b"observation")

        sample = heard.wait()
        assert (read_key(sample), read_payload(sample)) == (own, b"orders")
        assert read_payload(seen.wait()) == b"observation"


def test_strangers_may_not_come_as_workers_do(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"^workers are known by unixsock-stream/, where nobody else may connect; listen at tcp/"
    ):
        open_router(f"{WORKERS_PROTOCOL}/{tmp_path}/a", "p", workers_endpoint=f"{WORKERS_PROTOCOL}/{tmp_path}/w")
