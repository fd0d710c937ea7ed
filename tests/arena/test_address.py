import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.address import DEFAULT_ENDPOINT, DEFAULT_PIT, Address, parse_address
from arena.errors import InputError


@given(
    st.sampled_from(["127.0.0.1", "pit.example.org", "[::1]", "localhost"]),
    st.integers(0, 65535),
    st.from_regex(r"[A-Za-z0-9_-]{1,64}", fullmatch=True),
)
def test_an_address_is_read_as_it_is_printed(host: str, port: int, pit: str) -> None:
    address = Address(endpoint=f"tcp/{host}:{port}", pit=pit)

    assert parse_address(str(address)) == address


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:7447", "tls/pit.example.org:7447", "unixsock-stream//tmp/pit.sock", "tcp/[::1]:1"]
)
def test_an_endpoint_is_an_address(endpoint: str) -> None:
    assert parse_address(endpoint) == Address(endpoint=endpoint, pit=DEFAULT_PIT)


def test_without_a_pit_it_is_the_usual_one() -> None:
    assert parse_address("arena://127.0.0.1:7447") == Address(endpoint=DEFAULT_ENDPOINT)
    assert parse_address("arena://127.0.0.1:7447/") == Address()


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
    ],
)
def test_what_is_no_address_is_refused_in_a_sentence(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_address(text)

    assert "\n" not in str(caught.value)
