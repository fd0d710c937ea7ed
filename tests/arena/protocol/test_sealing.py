"""Sealed messages: their exact bytes, made again here without the arena; and that nothing but the next genuine one opens."""

import hmac
from collections.abc import Callable
from typing import Any

import pytest
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ForgedError, ProtocolError, ReplayedError
from arena.game.types import Team
from arena.protocol import sealing
from arena.protocol.messages import PROTOCOL_VERSION
from arena.protocol.sealing import (
    PAD_BYTES,
    Direction,
    Opener,
    Sealer,
    derive_key,
    pad,
    seat_context,
    truth_opener,
    truth_sealer,
    unpad,
)

SECRET = bytes(range(32))
KEY = bytes(range(32, 64))
HEAD_BYTES = 12
TAG_BYTES = 16
MULTIPLES = st.sampled_from([1, 2, 16, PAD_BYTES, 500])
TICKS = st.integers(0, 2**32 - 1)
PLACE: dict[str, Any] = {"pit": "pit", "match": "0123", "team": Team.BLUE, "direction": Direction.ACTION}
CONTEXT = seat_context(**PLACE)


def plain_hkdf(secret: bytes, info: bytes, n_bytes: int) -> bytes:
    """Return what RFC 5869 says, by nothing but HMAC; without salt."""
    key = hmac.digest(bytes(32), secret, "sha256")
    block, blocks = b"", b""
    for number in range(1, -(-n_bytes // 32) + 1):
        block = hmac.digest(key, block + info + bytes([number]), "sha256")
        blocks += block
    return blocks[:n_bytes]


def plain_seal(key: bytes, context: bytes, multiple: int, count: int, tick: int, data: bytes) -> bytes:
    """Return what a sealed message must be, by nothing but ChaCha20-Poly1305."""
    padding = b"\x80" + b"\x00" * ((multiple - (len(data) + 1) % multiple) % multiple)
    counter, moment = count.to_bytes(8, "big"), tick.to_bytes(4, "big")
    return counter + moment + ChaCha20Poly1305(key).encrypt(b"\x00\x00\x00\x00" + counter, data + padding, context + moment)


def is_refused(opener: Opener, data: bytes, error: type[ProtocolError] = ForgedError) -> None:
    with pytest.raises(error):
        opener.open(data)


# Keys


def test_the_plain_hkdf_of_these_tests_is_that_of_rfc_5869() -> None:
    """Appendix A.3."""
    expected = "8da4e775a563c18f715f802a063c5a31b8a11f5c5ee1879ec3454e5f3c738d2d9d201395faa4b61a96c8"

    assert plain_hkdf(b"\x0b" * 22, b"", 42).hex() == expected


def test_a_derived_key_is_hkdf_sha256_over_the_label_and_every_part_behind_its_length() -> None:
    info = b"\x00\x00\x00\x0aarena seat" + b"\x00\x00\x00\x03pit" + b"\x00\x00\x00\x00" + b"\x00\x00\x00\x04BLUE"

    key = derive_key(SECRET, "seat", b"pit", b"", b"BLUE")

    assert key == plain_hkdf(SECRET, info, 32)
    assert key.hex() == "6bf15196507f952ed3a1debec598ba97519fa61c545778658b7ed7ebc357e93c"


@given(st.binary(min_size=1, max_size=70), st.text(max_size=9), st.lists(st.binary(max_size=40), max_size=4))
def test_every_derived_key_is_that_of_plain_hkdf(secret: bytes, label: str, parts: list[bytes]) -> None:
    info = b"".join(len(part).to_bytes(4, "big") + part for part in [b"arena " + label.encode(), *parts])

    assert derive_key(secret, label, *parts) == plain_hkdf(secret, info, 32)


def test_a_key_differs_by_secret_label_and_every_part_and_by_where_a_part_ends() -> None:
    keys = {
        derive_key(SECRET, "seat", b"ab", b"c"),
        derive_key(KEY, "seat", b"ab", b"c"),
        derive_key(SECRET, "truth", b"ab", b"c"),
        derive_key(SECRET, "seat", b"a", b"bc"),
        derive_key(SECRET, "seat", b"abc"),
        derive_key(SECRET, "seat", b"ab", b"c", b""),
        derive_key(SECRET, "seat", b"c", b"ab"),
        derive_key(SECRET, "seatab", b"c"),
    }

    assert len(keys) == 8


def test_the_place_of_a_message_is_version_pit_match_team_and_direction() -> None:
    assert CONTEXT == b"arena %d/pit/0123/BLUE/action/" % PROTOCOL_VERSION
    assert seat_context("q", "9", Team.RED, Direction.OBSERVATION) == b"arena %d/q/9/RED/observation/" % PROTOCOL_VERSION


# The bytes


def test_a_sealed_message_is_counter_tick_and_chacha20_poly1305_of_the_padded_message() -> None:
    sealer = Sealer(KEY, CONTEXT)
    sealer.close(b"the first", 3)

    sealed = sealer.close(b"orders", 4)

    cipher = ChaCha20Poly1305(bytes(range(32, 64)))
    nonce = bytes.fromhex("00000000" + "0000000000000001")
    place = b"arena %d/pit/0123/BLUE/action/" % PROTOCOL_VERSION + bytes.fromhex("00000004")
    padded = b"orders" + b"\x80" + b"\x00" * 57
    assert sealed == bytes.fromhex("0000000000000001" + "00000004") + cipher.encrypt(nonce, padded, place)


@given(st.lists(st.tuples(st.binary(max_size=200), TICKS), min_size=1, max_size=5), MULTIPLES)
def test_every_sealed_message_is_the_documented_one(messages: list[tuple[bytes, int]], multiple: int) -> None:
    sealer = Sealer(KEY, CONTEXT, multiple)

    for count, (data, tick) in enumerate(messages):
        assert sealer.close(data, tick) == plain_seal(KEY, CONTEXT, multiple, count, tick, data)


@given(st.lists(st.tuples(st.binary(max_size=200), TICKS), min_size=1, max_size=5), MULTIPLES)
def test_whatever_is_closed_opens_as_it_was(messages: list[tuple[bytes, int]], multiple: int) -> None:
    sealer, opener = Sealer(KEY, CONTEXT, multiple), Opener(KEY, CONTEXT)

    for data, tick in messages:
        assert opener.open(sealer.close(data, tick)) == data


@given(st.binary(max_size=200), MULTIPLES)
def test_what_is_padded_is_a_multiple_and_comes_back(data: bytes, multiple: int) -> None:
    padded = pad(data, multiple)

    assert len(padded) % multiple == 0
    assert len(data) < len(padded) <= len(data) + multiple
    assert unpad(padded) == data


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x00" * 64, b"a", b"a\x00", b"\x80a\x00", b"\x81\x00"])
def test_what_lacks_its_padding_is_forged_though_the_key_holder_sealed_it(data: bytes) -> None:
    sealed = bytes(HEAD_BYTES) + ChaCha20Poly1305(KEY).encrypt(bytes(12), data, CONTEXT + bytes(4))

    with pytest.raises(ForgedError, match="padding"):
        Opener(KEY, CONTEXT).open(sealed)


# Lengths


@pytest.mark.parametrize("multiple", [64, 512])
def test_the_length_tells_only_how_many_multiples_were_needed(multiple: int) -> None:
    sealer = Sealer(KEY, CONTEXT, multiple)

    for n_bytes in range(2 * multiple + 2):
        needed = n_bytes // multiple + 1
        assert len(sealer.close(bytes(n_bytes), n_bytes)) == HEAD_BYTES + TAG_BYTES + needed * multiple


@given(st.binary(max_size=PAD_BYTES - 1), st.binary(max_size=PAD_BYTES - 1), TICKS, TICKS)
def test_all_contents_of_one_class_are_of_one_length(one: bytes, other: bytes, tick: int, other_tick: int) -> None:
    sealer = Sealer(KEY, CONTEXT)

    assert len(sealer.close(one, tick)) == len(sealer.close(other, other_tick))


def test_one_content_closed_twice_is_two_ciphertexts_with_nothing_in_common() -> None:
    sealer = Sealer(KEY, CONTEXT)

    one, other = (sealer.close(bytes(63), 5)[HEAD_BYTES:] for _ in range(2))

    assert sum(a == b for a, b in zip(one, other, strict=True)) < 10


# What does not open


def test_no_bit_can_be_changed_and_a_failed_opening_changes_nothing() -> None:
    sealer, opener = Sealer(KEY, CONTEXT), Opener(KEY, CONTEXT)
    opener.open(sealer.close(b"before", 0))
    sealed = sealer.close(b"orders", 1)

    for bit in range(8 * len(sealed)):
        is_refused(opener, (int.from_bytes(sealed, "big") ^ 1 << bit).to_bytes(len(sealed), "big"))

    assert opener.open(sealed) == b"orders"


def test_no_bit_of_the_last_message_can_be_changed_when_it_comes_again() -> None:
    sealer, opener = Sealer(KEY, CONTEXT), Opener(KEY, CONTEXT)
    sealed = sealer.close(b"orders", 1)
    opener.open(sealed)

    for bit in range(8 * len(sealed)):
        is_refused(opener, (int.from_bytes(sealed, "big") ^ 1 << bit).to_bytes(len(sealed), "big"))

    assert opener.open(sealed) == b"orders"


def test_nothing_can_be_cut_off_or_added() -> None:
    sealed = Sealer(KEY, CONTEXT).close(b"orders", 1)
    opener = Opener(KEY, CONTEXT)

    for n_bytes in range(len(sealed)):
        is_refused(opener, sealed[:n_bytes])
        is_refused(opener, sealed[n_bytes + 1 :])
    for more in (b"\x00", b"\x80", bytes(64), sealed):
        is_refused(opener, sealed + more)
        is_refused(opener, more + sealed)

    assert opener.open(sealed) == b"orders"


@given(st.binary(max_size=200))
def test_any_bytes_are_forged_and_nothing_worse(data: bytes) -> None:
    opener = Opener(KEY, CONTEXT)

    is_refused(opener, data)
    assert opener.open(Sealer(KEY, CONTEXT).close(b"orders", 1)) == b"orders"


@pytest.mark.parametrize("moved", [{"pit": "pit2"}, {"match": "0124"}, {"team": Team.RED}, {"direction": Direction.OBSERVATION}])
def test_a_message_does_not_open_in_another_place_even_under_the_same_key(moved: dict[str, Any]) -> None:
    opener = Opener(KEY, CONTEXT)

    is_refused(opener, Sealer(KEY, seat_context(**{**PLACE, **moved})).close(b"orders", 1))
    assert opener.open(Sealer(KEY, CONTEXT).close(b"orders", 1)) == b"orders"


def test_a_message_of_another_version_of_the_protocol_does_not_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sealing, "PROTOCOL_VERSION", PROTOCOL_VERSION + 1)
    sealed = Sealer(KEY, seat_context(**PLACE)).close(b"orders", 1)

    is_refused(Opener(KEY, CONTEXT), sealed)


@given(TICKS, TICKS)
def test_a_message_cannot_be_moved_to_another_tick(tick: int, other: int) -> None:
    sealed = Sealer(KEY, CONTEXT).close(b"orders", tick)

    if tick != other:
        is_refused(Opener(KEY, CONTEXT), sealed[:8] + other.to_bytes(4, "big") + sealed[HEAD_BYTES:])


def test_a_message_cannot_be_given_another_counter() -> None:
    sealed = Sealer(KEY, CONTEXT).close(b"orders", 1)

    for count in (1, 2, 2**64 - 1):
        is_refused(Opener(KEY, CONTEXT), count.to_bytes(8, "big") + sealed[8:])


def test_another_key_opens_nothing() -> None:
    is_refused(Opener(SECRET, CONTEXT), Sealer(KEY, CONTEXT).close(b"orders", 1))


# The order of messages


def close(n_messages: int) -> list[bytes]:
    sealer = Sealer(KEY, CONTEXT)
    return [sealer.close(b"%d" % number, number) for number in range(n_messages)]


def test_an_earlier_message_does_not_open_again() -> None:
    first, second, third = close(3)
    opener = Opener(KEY, CONTEXT)
    opener.open(first)
    opener.open(second)

    with pytest.raises(ReplayedError, match="second time, or late"):
        opener.open(first)
    assert opener.open(third) == b"2"


def test_the_very_last_message_may_come_again_as_it_was() -> None:
    first, second = close(2)
    opener = Opener(KEY, CONTEXT)

    assert [opener.open(data) for data in (first, first, first, second, second)] == [b"0", b"0", b"0", b"1", b"1"]


def test_a_message_may_be_lost_and_does_not_open_once_a_later_one_did() -> None:
    first, second, third = close(3)
    opener = Opener(KEY, CONTEXT)

    assert opener.open(first) == b"0"
    assert opener.open(third) == b"2"
    is_refused(opener, second, ReplayedError)
    is_refused(opener, first, ReplayedError)


def test_what_comes_again_and_is_changed_is_forged() -> None:
    first, second = close(2)
    opener = Opener(KEY, CONTEXT)
    opener.open(second)

    for genuine in (first, second):
        is_refused(opener, genuine[:-1] + bytes([genuine[-1] ^ 1]))


def test_it_can_be_told_what_was_sealed_under_a_key_at_any_time() -> None:
    first, second = close(2)
    opener = Opener(KEY, CONTEXT)
    opener.open(second)

    assert [opener.has_sealed(data) for data in (first, second, first[:-1], b"", b"junk" * 30)] == [True, True, *[False] * 3]


def test_another_message_under_the_counter_of_the_last_does_not_open_though_the_key_holder_sealed_it() -> None:
    opener = Opener(KEY, CONTEXT)
    opener.open(plain_seal(KEY, CONTEXT, 64, 0, 1, b"north"))

    is_refused(opener, plain_seal(KEY, CONTEXT, 64, 0, 1, b"south"), ReplayedError)


@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=30))
def test_however_messages_arrive_each_opens_once_in_order_but_for_repeats_of_the_last(arrivals: list[tuple[int, bool]]) -> None:
    sealed = close(6)
    opener, last = Opener(KEY, CONTEXT), -1

    for number, is_forged in arrivals:
        if is_forged or number < last:
            error = ForgedError if is_forged else ReplayedError
            is_refused(opener, sealed[number][:-1] + bytes([sealed[number][-1] ^ is_forged]), error)
        else:
            assert opener.open(sealed[number]) == b"%d" % number
            last = number


# Nonces


def test_no_nonce_is_used_twice_under_a_key(monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[tuple[bytes, bytes]] = []

    class Recorder:
        def __init__(self, key: bytes) -> None:
            self.key = key

        def encrypt(self, nonce: bytes, data: bytes, associated: bytes) -> bytes:
            used.append((self.key, nonce))
            return ChaCha20Poly1305(self.key).encrypt(nonce, data, associated)

    monkeypatch.setattr(sealing, "ChaCha20Poly1305", Recorder)
    sealers = [Sealer(key, CONTEXT) for key in (KEY, SECRET)]
    for number in range(2_000):
        sealers[number % 2].close(b"the same", tick=number % 3)  # ticks repeat: they must not make the nonce

    assert len(used) == 2_000
    assert len(set(used)) == 2_000
    assert {len(nonce) for _, nonce in used} == {12}


def test_a_counter_above_32_bits_is_still_part_of_the_nonce() -> None:
    sealer = Sealer(KEY, CONTEXT)
    sealer._count = 2**32

    assert sealer.close(b"x", 0) == plain_seal(KEY, CONTEXT, 64, 2**32, 0, b"x")


# The truth


def test_the_truth_is_sealed_under_a_key_of_secret_salt_pit_and_match() -> None:
    info = b"".join(len(part).to_bytes(4, "big") + part for part in (b"arena truth", b"salt", b"pit", b"0123"))

    sealed = truth_sealer(SECRET, b"salt", "pit", "0123").close(b"board", 7)

    assert sealed == plain_seal(plain_hkdf(SECRET, info, 32), b"arena %d/pit/0123/truth/" % PROTOCOL_VERSION, 64, 0, 7, b"board")
    assert truth_opener(SECRET, b"salt", "pit", "0123").open(sealed) == b"board"


@pytest.mark.parametrize(
    "other",
    [
        lambda: truth_opener(KEY, b"salt", "pit", "0123"),
        lambda: truth_opener(SECRET, b"pepper", "pit", "0123"),
        lambda: truth_opener(SECRET, b"salt", "pit2", "0123"),
        lambda: truth_opener(SECRET, b"salt", "pit", "0124"),
        lambda: Opener(SECRET, CONTEXT),
    ],
)
def test_the_truth_opens_to_no_other_secret_process_pit_or_match(other: Callable[[], Opener]) -> None:
    is_refused(other(), truth_sealer(SECRET, b"salt", "pit", "0123").close(b"board", 7))
