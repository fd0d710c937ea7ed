from collections.abc import Callable
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import InputError
from arena.network.address import DEFAULT_ENDPOINT, DEFAULT_PIT, Address, check_endpoint, parse_address
from arena.network.session import Session, open_client, open_router
from arena.protocol.identity import PUBLIC_BYTES, Identity, to_text


@given(
    st.sampled_from(["127.0.0.1", "pit.example.org", "[::1]", "localhost"]),
    st.integers(0, 65535),
    st.from_regex(r"[A-Za-z0-9_-]{1,64}", fullmatch=True),
    st.sampled_from(["tcp", "tls", "quic", "ws", "udp"]),
    st.just("") | st.binary(min_size=PUBLIC_BYTES, max_size=PUBLIC_BYTES).map(to_text),
)
def test_an_address_is_read_as_it_is_printed(host: str, port: int, pit: str, protocol: str, fingerprint: str) -> None:
    address = Address(endpoint=f"{protocol}/{host}:{port}", pit=pit, fingerprint=fingerprint)

    assert parse_address(str(address)) == address


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:7447", "tls/pit.example.org:7447", "unixsock-stream//tmp/pit.sock", "tcp/[::1]:1"]
)
def test_an_endpoint_is_an_address(endpoint: str) -> None:
    assert parse_address(endpoint) == Address(endpoint=endpoint, pit=DEFAULT_PIT)


def test_without_a_pit_it_is_the_usual_one() -> None:
    assert parse_address("arena://127.0.0.1:7447") == Address(endpoint=DEFAULT_ENDPOINT)
    assert parse_address("arena://127.0.0.1:7447/") == Address()


def test_a_pit_behind_tls_has_a_scheme_of_its_own() -> None:
    address = parse_address(f"arena+tls://pit.example.org:7447/melee#{'A' * 43}")

    assert address == Address(endpoint="tls/pit.example.org:7447", pit="melee", fingerprint="A" * 43)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "nonsense",
        "tcp/",
        "tcp",
        "carrier/pigeon",
        "http://127.0.0.1:7447/pit",
        "arena://",
        "arena:///pit",
        "arena://127.0.0.1/pit",
        "arena://:7447/pit",
        "arena://127.0.0.1:port/pit",
        "arena://127.0.0.1:99999/pit",
        "arena://127.0.0.1:1/a/b",
        "arena://127.0.0.1:1/a*",
        "arena://[::1/pit",
        "arena+tls://127.0.0.1/pit",
        "arena+carrier://127.0.0.1:1/pit",
        "arena://127.0.0.1:1/pit#short",
        f"arena://127.0.0.1:1/pit#{'A' * 44}",
        f"arena://127.0.0.1:1/pit#{'A' * 42}*",
        f"arena://127.0.0.1:1/pit#{'A' * 42}B",
    ],
)
def test_what_is_no_address_is_refused_in_a_sentence(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_address(text)

    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("endpoint", "here"),
    [
        ("tcp/0.0.0.0:7447", "tcp/127.0.0.1:7447"),
        ("tls/[::]:7447", "tls/[::1]:7447"),
        ("tcp/10.0.0.0:7447", "tcp/10.0.0.0:7447"),
        ("unixsock-stream//run/pit", "unixsock-stream//run/pit"),
    ],
)
def test_a_pit_that_listens_everywhere_is_reached_on_loopback(endpoint: str, here: str) -> None:
    assert Address(endpoint=endpoint, pit="pit", fingerprint="").from_here() == Address(endpoint=here, pit="pit")


def test_a_pit_at_a_unix_socket_has_an_address_that_is_read_back() -> None:
    key = Identity.make().fingerprint
    address = Address(endpoint="unixsock-stream//tmp/a/pit.sock", pit="mine", fingerprint=key)

    assert str(address) == f"arena+unix:///tmp/a/pit.sock/mine#{key}"
    assert parse_address(str(address)) == address
    for text in ("arena+unix:///mine", "arena+unix://host/path/mine"):
        with pytest.raises(InputError, match="lacks the path of a socket"):
            parse_address(text)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("/tmp/" + "x" * 103, "has 108 bytes, and the system takes 107; choose a shorter one"),
        ("/nowhere/at/all", "the folder of the socket /nowhere/at/all does not exist; make it first"),
        ("pit.sock", "needs a path from the root"),
    ],
)
@pytest.mark.parametrize("open_end", [lambda where: open_router(where, "p"), open_client])
def test_a_socket_that_cannot_be_is_one_sentence(path: str, said: str, open_end: Callable[[str], Session]) -> None:
    with pytest.raises(InputError, match=said):
        open_end(f"unixsock-stream/{path}")


@pytest.mark.parametrize(
    ("endpoint", "said"),
    [
        ("127.0.0.1:7447", "^'127.0.0.1:7447' is no endpoint; write tcp/HOST:PORT$"),
        ("7447", "is no endpoint; write tcp/HOST:PORT$"),
        ("tcp/127.0.0.1", "^'tcp/127.0.0.1' lacks a host or a port; write tcp/HOST:PORT$"),
        ("tls/:7447", "lacks a host or a port; write tls/HOST:PORT$"),
        ("tcp/127.0.0.1:http", "lacks a host or a port; write tcp/HOST:PORT$"),
    ],
)
@pytest.mark.parametrize("open_end", [lambda where: open_router(where, "p"), open_client])
def test_what_is_no_endpoint_is_one_sentence(endpoint: str, said: str, open_end: Callable[[str], Session]) -> None:
    with pytest.raises(InputError, match=said):
        open_end(endpoint)


@pytest.mark.parametrize(
    "endpoint", ["tcp/0.0.0.0:7447", "tcp/[::1]:7447", "tls/arena.example.org:443", "tcp/127.0.0.1:0?prio=1#so=1"]
)
def test_an_endpoint_with_a_host_and_a_port_is_taken(endpoint: str) -> None:
    check_endpoint(endpoint)


def test_the_longest_path_of_a_socket_is_taken() -> None:
    with TemporaryDirectory(dir="/tmp") as folder:
        endpoint = f"unixsock-stream/{folder}/".ljust(len("unixsock-stream/") + 107, "x")
        with open_router(endpoint, "p"), open_client(endpoint) as client:
            assert client.name
