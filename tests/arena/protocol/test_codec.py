from dataclasses import fields, replace
from typing import Any, get_args

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import UnreadableError
from arena.game.ruleset import load, to_dict
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.messages import (
    PROTOCOL_VERSION,
    AdminRequest,
    Commitment,
    Ended,
    JoinRequest,
    Message,
    Orders,
    Ready,
    Signed,
    Ticket,
    Turn,
)

KINDS: tuple[type, ...] = get_args(Message)
WHOLE = st.integers(-(2**63), 2**64 - 1)
PLAIN = st.recursive(
    st.none() | st.booleans() | WHOLE | st.floats(allow_nan=False) | st.text(max_size=9) | st.binary(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
VALUES: dict[Any, st.SearchStrategy[Any]] = {
    int: WHOLE,
    str: st.text(max_size=70),
    bytes: st.binary(max_size=200),
    float: st.floats(allow_nan=False),
    int | None: st.none() | WHOLE,
    str | None: st.none() | st.text(max_size=9),
    float | None: st.none() | st.floats(allow_nan=False),
    list[int]: st.lists(WHOLE, max_size=4),
    list[dict[str, Any]]: st.lists(st.dictionaries(st.text(max_size=9), PLAIN, max_size=3), max_size=3),
    bool: st.booleans(),
    list[str]: st.lists(st.text(max_size=9), max_size=3),
    list[bytes]: st.lists(st.binary(max_size=50), max_size=4),
    dict[str, Any]: st.dictionaries(st.text(max_size=9), PLAIN, max_size=4),
    dict[str, dict[str, int]]: st.dictionaries(
        st.text(max_size=5), st.dictionaries(st.text(max_size=5), WHOLE, max_size=3), max_size=3
    ),
}
MESSAGES = st.one_of([st.builds(kind, **{field.name: VALUES[field.type] for field in fields(kind)}) for kind in KINDS])
TICKET = Ticket(
    match="0123456789abcdef",
    lane=7,
    team=1,
    ruleset={"name": "paper", **to_dict(load("paper"))},
    opponent="ann",
    turn_time_s=None,
    bank_s=10.0,
    tick=7,
    secret=bytes(range(32)),
    commitment=encode(Signed(data=encode(Commitment(match="0123456789abcdef", digest=bytes(32))), signature=bytes(64))),
)

FILLED_IN = ["entry: bytes", "ephemeral: bytes", "reply_secret: bytes", "challenge: bytes", "pit_key: bytes"]


@given(MESSAGES)
def test_a_message_comes_back_as_it_was(message: Message) -> None:
    assert decode(encode(message)) == message


def test_a_ticket_carries_a_ruleset() -> None:
    assert decode(encode(TICKET)) == TICKET
    assert len(encode(TICKET)) < 1_000


def test_a_field_that_came_later_is_left_out_at_its_default_and_else_refused_by_who_does_not_know_it() -> None:
    delayed = replace(TICKET, public_delay=20)
    bytes_of_before, bytes_of_now = msgpack.unpackb(encode(TICKET)), msgpack.unpackb(encode(delayed))

    assert bytes_of_now == [*bytes_of_before, 20]
    assert decode(encode(delayed)) == delayed
    with pytest.raises(UnreadableError, match="Ticket has 12 fields, not 13"):
        decode(msgpack.packb([*bytes_of_now, None, 1]))
    with pytest.raises(UnreadableError, match="Ticket has 12 fields, not 9"):
        decode(msgpack.packb(bytes_of_before[:-1]))


def test_a_whole_number_will_do_for_seconds() -> None:
    data = encode(TICKET).replace(msgpack.packb(10.0), msgpack.packb(10))

    message = decode(data)

    assert isinstance(message, Ticket)
    assert message.bank_s == 10


def is_read_or_refused(data: bytes) -> None:
    """Decode, and let nothing but `UnreadableError` pass."""
    try:
        message = decode(data)
    except UnreadableError:
        return
    assert type(message) in KINDS


@given(MESSAGES, st.data())
def test_changed_bytes_are_a_message_or_unreadable(message: Message, data: st.DataObject) -> None:
    changed = bytearray(encode(message))
    for _ in range(data.draw(st.integers(1, 4))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))

    is_read_or_refused(bytes(changed))


@given(MESSAGES, st.floats(0, 1, exclude_max=True))
def test_truncated_bytes_are_unreadable(message: Message, part: float) -> None:
    data = encode(message)

    with pytest.raises(UnreadableError):
        decode(data[: int(part * len(data))])


@given(MESSAGES, st.binary(min_size=1, max_size=5))
def test_bytes_behind_a_message_are_unreadable(message: Message, more: bytes) -> None:
    with pytest.raises(UnreadableError):
        decode(encode(message) + more)


@given(st.binary(max_size=300))
def test_random_bytes_are_a_message_or_unreadable(data: bytes) -> None:
    is_read_or_refused(data)


@given(
    st.one_of(
        PLAIN,
        st.lists(PLAIN, max_size=9),
        st.builds(lambda *rest: [PROTOCOL_VERSION, *rest], st.integers(-2, len(KINDS) + 1), PLAIN, PLAIN),
    )
)
def test_msgpack_that_is_no_message_is_unreadable_or_a_message(value: Any) -> None:
    is_read_or_refused(msgpack.packb(value))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        msgpack.packb([]),
        msgpack.packb({}),
        msgpack.packb([PROTOCOL_VERSION]),
        msgpack.packb([True, 5, 0]),
        msgpack.packb([PROTOCOL_VERSION, True, 0]),
        msgpack.packb([PROTOCOL_VERSION, -1, 0]),
        msgpack.packb([PROTOCOL_VERSION, len(KINDS), 0]),
        msgpack.packb([PROTOCOL_VERSION, KINDS.index(Ready)]),
        msgpack.packb([PROTOCOL_VERSION, KINDS.index(Ready), 1, 2]),
        msgpack.packb([PROTOCOL_VERSION, KINDS.index(Ready), "1"]),
        msgpack.packb([PROTOCOL_VERSION, KINDS.index(Ready), True]),
        msgpack.packb([PROTOCOL_VERSION, KINDS.index(Ready), 1.0]),
        msgpack.packb([PROTOCOL_VERSION, KINDS.index(Orders), 0, "text"]),
        b"\xdd\xff\xff\xff\xff",
        b"\xc6\xff\xff\xff\xff",
        b"\x91" * 50_000,
        b"\x93\x02\x07\xa4\xff\xff\xff\xff",
        b"\x82\x90\x01\x90\x02",
    ],
)
def test_what_looks_like_a_message_and_is_none_is_unreadable(data: bytes) -> None:
    with pytest.raises(UnreadableError):
        decode(data)


def test_a_message_that_is_too_long_is_not_even_looked_at() -> None:
    with pytest.raises(UnreadableError, match="60001 bytes"):
        decode(bytes(MOST_BYTES + 1))


def test_another_version_is_refused_in_one_sentence() -> None:
    values = msgpack.unpackb(encode(Ready(known_ticks=1)))

    with pytest.raises(
        UnreadableError, match=rf"^the other side speaks version 99 of the protocol; this is version {PROTOCOL_VERSION}$"
    ):
        decode(msgpack.packb([99, *values[1:], "and what version 99 adds"]))


def test_a_change_of_a_message_is_a_change_of_the_protocol() -> None:
    """Who changes a field, changes this, and raises PROTOCOL_VERSION once a version has been published."""
    shape = {
        kind.__name__: [f"{field.name}: {getattr(field.type, '__name__', field.type)}" for field in fields(kind)]
        for kind in KINDS
    }

    assert PROTOCOL_VERSION == 4
    assert [kind.__name__ for kind in KINDS] == [
        "ChallengeRequest",
        "Challenge",
        "SealedRequest",
        "SealedAnswer",
        "JoinRequest",
        "AdminRequest",
        "Done",
        "Ticket",
        "Wait",
        "Refusal",
        "Closed",
        "Ready",
        "Turn",
        "History",
        "Orders",
        "Signed",
        "Commitment",
        "Ended",
        "Receipt",
        "PublicState",
        "Truth",
        "JournalRequest",
        "JournalPiece",
        "Lobby",
        "PastTruth",
        "SeasonRequest",
        "SeasonAnswer",
        "Bundle",
    ]
    assert shape["JoinRequest"] == [
        "rules_version: int",
        "name: str",
        "team: str",
        "client: str",
        "slot: int",
        "rules_hash: str",
        "match: str",
        "invite: str",
        *FILLED_IN,
        "version: str",
        "bundles: bool",
    ]
    assert shape["AdminRequest"] == ["command: str", "target: str", *FILLED_IN]
    assert shape["Challenge"] == ["pit_key: bytes", "sealing_key: bytes", "number: bytes", "signature: bytes"]
    assert shape["Ticket"][-4:] == ["secret: bytes", "commitment: bytes", "public_delay: int", "bundle_lane: int | None"]
    assert shape["Bundle"] == ["seats: list", "messages: list"]
    for name, only in (
        ("SealedRequest", ["sealed: bytes"]),
        ("SealedAnswer", ["sealed: bytes"]),
        ("Signed", ["data: bytes", "signature: bytes"]),
    ):
        assert shape[name] == only
    assert shape["Commitment"] == ["match: str", "digest: bytes"]
    assert shape["Receipt"] == ["n_shown: int", "head: bytes", "signature: bytes"]
    assert shape["Turn"] == ["tick: int", "observation: bytes", "charged_us: int"]
    assert shape["History"][-1] == "end_tick: int"
    assert shape["Orders"] == ["tick: int", "actions: bytes"]


def test_messages_of_a_turn_are_small() -> None:
    assert len(encode(Orders(tick=99, actions=bytes(6)))) <= 12
    assert len(encode(Turn(tick=99, observation=bytes(500)))) <= 510


def test_every_kind_of_message_is_made_here() -> None:
    assert {type(example) for example in (TICKET, Ready(known_ticks=0))} < set(KINDS)
    assert JoinRequest(rules_version=1, name="a", team="any", client="b", slot=0).entry == b""
    assert AdminRequest(command="ban", target="a").entry == b""
    assert Ended(match="m", ending="capture", winner=None, score=0, ticks=1, reason="").faults == {}
