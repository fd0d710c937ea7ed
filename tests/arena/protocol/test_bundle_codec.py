import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import UnreadableError
from arena.game.types import Team
from arena.protocol.bundles import MOST_MESSAGES, BundleWriter, read_bundle, read_seat_number, seat_number
from arena.protocol.codec import MOST_BYTES, encode
from arena.protocol.messages import PROTOCOL_VERSION, Bundle, Message, Ready

BUNDLE = 27


@given(st.integers(0, 999_999), st.sampled_from(Team))
def test_a_seat_is_read_back_from_its_number(lane: int, team: Team) -> None:
    assert read_seat_number(seat_number(lane, team)) == (lane, team)


@given(st.lists(st.tuples(st.integers(0, 2_000_000), st.sampled_from([0, 92, 700, 20_000, 51_000])), max_size=600))
def test_what_was_added_is_taken_once_in_its_order_and_no_bundle_is_too_long(added: list[tuple[int, int]]) -> None:
    writer = BundleWriter()
    for seat, n_bytes in added:
        writer.add(seat, bytes(n_bytes))

    assert bool(writer) is bool(added)
    bundles = writer.take()

    assert [(seat, len(message)) for bundle in bundles for seat, message in read_bundle(bundle)] == added
    assert all(len(bundle) <= MOST_BYTES for bundle in bundles)
    assert writer.take() == []
    assert not writer


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "the bytes are not msgpack"),
        (bytes(MOST_BYTES + 1), "no message is longer than"),
        (encode(Ready(known_ticks=0)), "this is no bundle"),
        (encode(Bundle(seats=[14], messages=[])), "names 1 seats for 0 messages"),
        (encode(Bundle(seats=[14] * (MOST_MESSAGES + 1), messages=[b""] * (MOST_MESSAGES + 1))), "none has more than 256"),
        (msgpack.packb([PROTOCOL_VERSION, BUNDLE, [14], ["text"]]), "Bundle.messages is of another type"),
        (msgpack.packb([PROTOCOL_VERSION, BUNDLE, [True], [b""]]), "Bundle.seats is of another type"),
        (msgpack.packb([PROTOCOL_VERSION, BUNDLE, [14], [[b""]]]), "Bundle.messages is of another type"),
        (msgpack.packb([PROTOCOL_VERSION, BUNDLE, [14], b""]), "Bundle.messages is of another type"),
        (b"\x91" * 3_000 + b"\x90", "the bytes are not msgpack"),
        (msgpack.packb([PROTOCOL_VERSION + 1, BUNDLE, [], []]), "the other side speaks version"),
    ],
)
def test_what_is_no_bundle_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(UnreadableError, match=why):
        read_bundle(data)


def test_a_bundle_in_a_bundle_is_bytes_like_any_other() -> None:
    inner: Message = Bundle(seats=[14], messages=[b"sealed"])

    assert read_bundle(encode(Bundle(seats=[15], messages=[encode(inner)]))) == [(15, encode(inner))]
