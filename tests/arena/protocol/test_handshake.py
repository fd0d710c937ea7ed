"""The handshake, joined at both ends without a network: the primitive is RFC 9180's, and a man in the middle gets nowhere."""

import hmac
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from typing import Any

import msgpack
import pytest
from cryptography.exceptions import InvalidTag
from cryptography.hazmat.bindings._rust import openssl
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ForgedError, ProtocolError
from arena.game.types import Team
from arena.protocol import handshake, sealing
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, Caller, check_challenge, new_secret, open_request, sign_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    PROTOCOL_VERSION,
    AdminRequest,
    Challenge,
    ChallengeRequest,
    JoinRequest,
    Message,
    Ready,
    SealedAnswer,
    SealedRequest,
    Wait,
)
from arena.protocol.sealing import Direction, Opener, Sealer, derive_key, seat_context

ANN = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32))))
MAN = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(100, 132))))
PIT = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32, 64))))
SEALING = X25519PrivateKey.from_private_bytes(bytes(range(64, 96)))
SEALING_KEY = SEALING.public_key().public_bytes_raw()
NUMBER = bytes(range(128, 160))
PIT_SECRET = bytes(range(160, 192))
CHALLENGE = sign_challenge("pit", PIT, SEALING_KEY, NUMBER)
JOIN = JoinRequest(rules_version=1, name="ann", team="any", client="c", slot=0)
ADMIN = AdminRequest(command="ban", target="bob")
WAIT = Wait(reason="for an opponent")
LOW_ORDER = [
    bytes(32),
    b"\x01" + bytes(31),
    bytes.fromhex("e0eb7a7c3b41b8ae1656e3faf19fc46ada098deb9c32b1fd866205165f49b800"),
    bytes.fromhex("5f9c95bca3508c24b1d0b1559c83ef5b04445cc4581c8e86d8224eddd09f1157"),
    bytes.fromhex("ec" + 30 * "ff" + "7f"),
    bytes.fromhex("ed" + 30 * "ff" + "7f"),
    bytes.fromhex("ee" + 30 * "ff" + "7f"),
    bytes(31) + b"\x80",
]
"""Points with which every X25519 exchange ends at zero (RFC 7748, section 6.1)."""


# RFC 9180, by nothing but HMAC, X25519 and ChaCha20-Poly1305


KEM = b"KEM" + bytes.fromhex("0020")
"""DHKEM(X25519, HKDF-SHA256)."""
HPKE = b"HPKE" + bytes.fromhex("0020" + "0001" + "0003")
"""The same, HKDF-SHA256, ChaCha20Poly1305."""


def extract(suite: bytes, salt: bytes, label: bytes, data: bytes) -> bytes:
    return hmac.digest(salt or bytes(32), b"HPKE-v1" + suite + label + data, "sha256")


def expand(suite: bytes, key: bytes, label: bytes, info: bytes, n_bytes: int) -> bytes:
    """Return one block of HKDF-Expand at most."""
    labelled = n_bytes.to_bytes(2, "big") + b"HPKE-v1" + suite + label + info
    return hmac.digest(key, labelled + b"\x01", "sha256")[:n_bytes]


def schedule(exchanged: bytes, enc: bytes, receiver: bytes, info: bytes) -> tuple[bytes, bytes, bytes]:
    """Return the shared secret, the key and the base nonce of base mode (RFC 9180, sections 4.1 and 5.1)."""
    shared = expand(KEM, extract(KEM, b"", b"eae_prk", exchanged), b"shared_secret", enc + receiver, 32)
    context = b"\x00" + extract(HPKE, b"", b"psk_id_hash", b"") + extract(HPKE, b"", b"info_hash", info)
    secret = extract(HPKE, shared, b"secret", b"")
    return shared, expand(HPKE, secret, b"key", context, 32), expand(HPKE, secret, b"base_nonce", context, 12)


def plain_encrypt(
    ephemeral: X25519PrivateKey, receiver: bytes, info: bytes, aad: bytes, data: bytes
) -> tuple[bytes, bytes, bytes, bytes]:
    """Return the shared secret, the key, the nonce, and enc || ct of the first message."""
    enc = ephemeral.public_key().public_bytes_raw()
    shared, key, nonce = schedule(ephemeral.exchange(X25519PublicKey.from_public_bytes(receiver)), enc, receiver, info)
    return shared, key, nonce, enc + ChaCha20Poly1305(key).encrypt(nonce, data, aad)


def plain_decrypt(private: X25519PrivateKey, info: bytes, aad: bytes, sealed: bytes) -> bytes:
    enc, ciphertext = sealed[:32], sealed[32:]
    exchanged = private.exchange(X25519PublicKey.from_public_bytes(enc))
    _, key, nonce = schedule(exchanged, enc, private.public_key().public_bytes_raw(), info)
    return ChaCha20Poly1305(key).decrypt(nonce, ciphertext, aad)


class Vector:
    """RFC 9180, appendix A.2.1: base mode, sequence number 0."""

    info = bytes.fromhex("4f6465206f6e2061204772656369616e2055726e")
    sender = X25519PrivateKey.from_private_bytes(
        bytes.fromhex("f4ec9b33b792c372c1d2c2063507b684ef925b8c75a42dbcbf57d63ccd381600")
    )
    receiver = X25519PrivateKey.from_private_bytes(
        bytes.fromhex("8057991eef8f1f1af18f4a9491d16a1ce333f695d4db8e38da75975c4478e0fb")
    )
    receiver_key = bytes.fromhex("4310ee97d88cc1f088a5576c77ab0cf5c3ac797f3d95139c6c84b5429c59662a")
    enc = bytes.fromhex("1afa08d3dec047a643885163f1180476fa7ddb54c6a8029ea33f95796bf2ac4a")
    shared = bytes.fromhex("0bbe78490412b4bbea4812666f7916932b828bba79942424abb65244930d69a7")
    key = bytes.fromhex("ad2744de8e17f4ebba575b3f5f5a8fa1f69c2a07f6e7500bc60ca6e3e3ec1c91")
    nonce = bytes.fromhex("5c4d98150661b848853b547f")
    aad = b"Count-0"
    text = bytes.fromhex("4265617574792069732074727574682c20747275746820626561757479")
    ciphertext = bytes.fromhex("1c5250d8034ec2b784ba2cfd69dbdb8af406cfe3ff938e131f0def8c8b60b4db21993c62ce81883d2dd1b51a28")


def test_the_suite_opens_the_vector_of_rfc_9180() -> None:
    opened = openssl.hpke._decrypt_with_aad(
        handshake._SUITE, Vector.enc + Vector.ciphertext, Vector.receiver, Vector.info, Vector.aad
    )

    assert opened == Vector.text == b"Beauty is truth, truth beauty"


def test_the_suite_does_not_open_the_vector_under_another_info_or_aad() -> None:
    for info, aad in ((b"other", Vector.aad), (Vector.info, b"Count-1"), (Vector.info, b"")):
        with pytest.raises(InvalidTag):
            openssl.hpke._decrypt_with_aad(handshake._SUITE, Vector.enc + Vector.ciphertext, Vector.receiver, info, aad)


def test_the_plain_rfc_9180_of_these_tests_makes_the_vector() -> None:
    shared, key, nonce, sealed = plain_encrypt(Vector.sender, Vector.receiver_key, Vector.info, Vector.aad, Vector.text)

    assert (shared, key, nonce) == (Vector.shared, Vector.key, Vector.nonce)
    assert sealed == Vector.enc + Vector.ciphertext
    assert plain_decrypt(Vector.receiver, Vector.info, Vector.aad, sealed) == Vector.text


@given(st.binary(max_size=200), st.binary(max_size=80))
def test_the_suite_is_plain_rfc_9180_in_both_directions(data: bytes, info: bytes) -> None:
    sealed = handshake._SUITE.encrypt(data, SEALING.public_key(), info)
    *_, plain = plain_encrypt(Vector.sender, SEALING_KEY, info, b"", data)

    assert plain_decrypt(SEALING, info, b"", sealed) == data
    assert handshake._SUITE.decrypt(plain, SEALING, info) == data


# Both ends, as the arena makes them


def ask(identity: Identity = ANN, request: JoinRequest | AdminRequest = JOIN, challenge: Challenge = CHALLENGE) -> Attempt:
    return Attempt(identity, "pit", challenge, request)


def hear(knock: bytes) -> Caller:
    return open_request(knock, "pit", PIT.public, SEALING)


def request_of(attempt: Attempt) -> JoinRequest:
    """Return what an attempt asked, as the pit reads it."""
    request = hear(attempt.sealed).request
    assert isinstance(request, JoinRequest)
    return request


def sealed_knock(data: bytes, *, pit: str = "pit", pit_key: bytes = PIT.public, sealing_key: bytes = SEALING_KEY) -> bytes:
    """Return a knock with anything in it, sealed by nothing of the arena's."""
    info = b"arena request\x00" + pit.encode() + b"\x00" + pit_key
    *_, sealed = plain_encrypt(X25519PrivateKey.generate(), sealing_key, info, b"", data)
    return encode(SealedRequest(sealed=sealed))


def signed_by(identity: Identity, request: Message) -> bytes:
    data = encode(request)
    return data + Ed25519PrivateKey.from_private_bytes(identity.private.private_bytes_raw()).sign(b"arena request\x00" + data)


WHOLE = replace(
    JOIN,
    entry=ANN.public,
    ephemeral=X25519PrivateKey.from_private_bytes(bytes(range(192, 224))).public_key().public_bytes_raw(),
    reply_secret=bytes(range(224, 256)),
    challenge=NUMBER,
    pit_key=PIT.public,
)
"""A request that `Attempt` might have made."""


@pytest.mark.parametrize("request_", [JOIN, ADMIN, replace(JOIN, name="é" * 40, invite="code", match="0123")])
def test_a_request_arrives_as_it_was_asked_with_what_the_attempt_fills_in(request_: JoinRequest | AdminRequest) -> None:
    heard = hear(ask(request=request_).sealed).request

    assert (heard.entry, heard.challenge, heard.pit_key) == (ANN.public, NUMBER, PIT.public)
    assert len(heard.ephemeral) == len(heard.reply_secret) == 32
    empty = dict.fromkeys(("entry", "ephemeral", "reply_secret", "challenge", "pit_key"), b"")
    assert replace(heard, **empty) == request_


def test_a_knock_is_a_request_and_its_plain_signature_sealed_by_rfc_9180() -> None:
    knock = decode(ask().sealed)
    assert isinstance(knock, SealedRequest)

    opened = plain_decrypt(SEALING, b"arena request\x00pit\x00" + PIT.public, b"", knock.sealed)

    Ed25519PublicKey.from_public_bytes(ANN.public).verify(opened[-64:], b"arena request\x00" + opened[:-64])
    assert isinstance(decode(opened[:-64]), JoinRequest)


def test_the_plain_knock_of_these_tests_is_let_in() -> None:
    """So that what is refused below is refused for the reason that it names."""
    assert hear(sealed_knock(signed_by(ANN, WHOLE))).request == WHOLE


def test_an_answer_is_sealed_by_rfc_9180_to_the_request_s_key_with_the_request_s_hash_and_secret() -> None:
    ephemeral = X25519PrivateKey.from_private_bytes(bytes(range(192, 224)))
    caller = hear(sealed_knock(signed_by(ANN, WHOLE)))

    answer = decode(caller.answer(WAIT))

    assert isinstance(answer, SealedAnswer)
    info = b"arena answer\x00" + sha256(caller.sealed).digest() + WHOLE.reply_secret
    assert decode(plain_decrypt(ephemeral, info, b"", answer.sealed)) == WAIT


def test_an_answer_opens_to_the_one_who_asked() -> None:
    attempt = ask()

    assert attempt.open(hear(attempt.sealed).answer(WAIT)) == WAIT


@pytest.mark.parametrize("identity", [ANN, MAN])
def test_an_answer_to_another_request_does_not_open(identity: Identity) -> None:
    one, other = ask(), ask(identity)

    with pytest.raises(ForgedError, match="does not open"):
        one.open(hear(other.sealed).answer(WAIT))


def test_an_answer_of_who_knows_the_ephemeral_key_alone_does_not_open() -> None:
    """The reply secret and the sealed request are what make an answer the pit's."""
    attempt = ask()
    caller = hear(attempt.sealed)

    for info in (
        b"",
        b"arena answer\x00" + sha256(caller.sealed).digest(),
        b"arena answer\x00" + sha256(caller.sealed).digest() + bytes(32),
        b"arena answer\x00" + sha256(b"another").digest() + caller.request.reply_secret,
        b"arena request\x00" + sha256(caller.sealed).digest() + caller.request.reply_secret,
    ):
        *_, sealed = plain_encrypt(X25519PrivateKey.generate(), caller.request.ephemeral, info, b"", encode(WAIT))
        with pytest.raises(ForgedError):
            attempt.open(encode(SealedAnswer(sealed=sealed)))


@pytest.mark.parametrize("message", [WAIT, Ready(known_ticks=0), ChallengeRequest(), SealedRequest(sealed=b"x" * 64)])
def test_an_answer_that_is_not_sealed_is_refused(message: Message) -> None:
    with pytest.raises(ForgedError, match="not sealed"):
        ask().open(encode(message))


def test_nothing_of_a_knock_can_be_known_or_linked_from_outside() -> None:
    one, other = ask(request=replace(JOIN, invite="the-invite-code")), ask(request=replace(JOIN, invite="the-invite-code"))
    request = hear(one.sealed).request

    for secret in (b"the-invite-code", b"ann", ANN.public, request.ephemeral, request.reply_secret):
        assert secret not in one.sealed
    assert one.sealed != other.sealed
    assert request.ephemeral != request_of(other).ephemeral
    assert request.reply_secret != request_of(other).reply_secret


def test_secrets_are_32_bytes_and_new_each_time() -> None:
    assert len({new_secret() for _ in range(100)}) == 100
    assert len(new_secret()) == 32


# The challenge


def test_a_challenge_is_signed_with_plain_ed25519_over_pit_sealing_key_and_number() -> None:
    signed = b"arena challenge\x00pit\x00" + SEALING_KEY + b"\x00" + NUMBER

    Ed25519PublicKey.from_public_bytes(PIT.public).verify(CHALLENGE.signature, signed)
    check_challenge("pit", CHALLENGE)


@pytest.mark.parametrize(
    "challenge",
    [
        replace(CHALLENGE, pit_key=MAN.public),
        replace(sign_challenge("pit", MAN, SEALING_KEY, NUMBER), pit_key=PIT.public),
        replace(CHALLENGE, sealing_key=Vector.receiver_key),
        replace(CHALLENGE, number=bytes(32)),
        replace(CHALLENGE, signature=bytes(64)),
        replace(CHALLENGE, signature=b""),
        replace(CHALLENGE, pit_key=b""),
        sign_challenge("other", PIT, SEALING_KEY, NUMBER),
        sign_challenge("", PIT, SEALING_KEY, NUMBER),
        replace(CHALLENGE, signature=PIT.sign("request", b"pit\x00" + SEALING_KEY + b"\x00" + NUMBER)),
    ],
)
def test_a_challenge_of_another_key_pit_sealing_key_number_or_label_is_refused(challenge: Challenge) -> None:
    with pytest.raises(ForgedError, match="challenge"):
        check_challenge("pit", challenge)


def test_a_challenge_is_refused_under_another_pit_s_name() -> None:
    for pit in ("other", "", "pi", "pitt", "PIT"):
        with pytest.raises(ForgedError):
            check_challenge(pit, CHALLENGE)


@pytest.mark.parametrize("sealing_key", [*LOW_ORDER, b"", bytes(31), b"\x09" + bytes(32)], ids=bytes.hex)
def test_nothing_is_sealed_to_a_key_that_everybody_could_open(sealing_key: bytes) -> None:
    with pytest.raises(ForgedError):
        ask(challenge=sign_challenge("pit", PIT, sealing_key, NUMBER))


# The man in the middle


def test_a_request_with_the_man_s_ephemeral_key_is_refused_for_he_cannot_sign_as_the_entry() -> None:
    """He is even given the whole request: the worst case."""
    signature = signed_by(ANN, WHOLE)[-64:]
    his = replace(WHOLE, ephemeral=X25519PrivateKey.generate().public_key().public_bytes_raw())

    for data in (encode(his) + signature, signed_by(MAN, his)):
        with pytest.raises(ForgedError, match="the signature of a request does not hold"):
            hear(sealed_knock(data))


@pytest.mark.parametrize(
    "change",
    [
        {"name": "man"},
        {"team": "red"},
        {"client": "d"},
        {"slot": 1},
        {"match": "0123"},
        {"invite": "code"},
        {"rules_version": 2},
        {"rules_hash": "h"},
        {"entry": MAN.public},
        {"reply_secret": bytes(32)},
        {"challenge": bytes(32)},
    ],
)
def test_no_field_of_a_signed_request_can_be_changed(change: dict[str, Any]) -> None:
    with pytest.raises(ForgedError, match="the signature of a request does not hold"):
        hear(sealed_knock(encode(replace(WHOLE, **change)) + signed_by(ANN, WHOLE)[-64:]))


def test_who_names_another_s_entry_is_refused() -> None:
    with pytest.raises(ForgedError, match="the signature of a request does not hold"):
        hear(sealed_knock(signed_by(MAN, WHOLE)))


@pytest.mark.parametrize("label", ["challenge", "fact", "receipt", "journal"])
def test_a_signature_given_for_something_else_makes_no_request(label: str) -> None:
    data = encode(WHOLE)

    with pytest.raises(ForgedError):
        hear(sealed_knock(data + ANN.sign(label, data)))


def test_a_request_to_a_malicious_pit_cannot_be_carried_on_to_this_one() -> None:
    """He runs a pit, opens what the entry asks of it, and seals it to this pit as it is."""
    his_sealing = X25519PrivateKey.generate()
    his = sign_challenge("pit", MAN, his_sealing.public_key().public_bytes_raw(), NUMBER)
    knock = decode(ask(challenge=his).sealed)
    assert isinstance(knock, SealedRequest)
    opened = plain_decrypt(his_sealing, b"arena request\x00pit\x00" + MAN.public, b"", knock.sealed)

    with pytest.raises(ForgedError, match="no request to this pit"):
        hear(sealed_knock(opened))


@pytest.mark.parametrize("pit_key", [MAN.public, b"", PIT.public[:-1]])
def test_a_request_with_another_pit_s_key_inside_is_refused(pit_key: bytes) -> None:
    with pytest.raises(ForgedError, match="no request to this pit"):
        hear(sealed_knock(signed_by(ANN, replace(WHOLE, pit_key=pit_key))))


@pytest.mark.parametrize(
    "elsewhere",
    [{"pit": "other"}, {"pit_key": MAN.public}, {"sealing_key": Vector.receiver_key}],
)
def test_a_knock_that_was_sealed_to_another_pit_or_another_key_does_not_open(elsewhere: dict[str, Any]) -> None:
    with pytest.raises(ForgedError, match="a request does not open"):
        hear(sealed_knock(signed_by(ANN, WHOLE), **elsewhere))


def test_a_knock_opens_at_one_pit_only() -> None:
    knock = ask().sealed

    for pit, pit_key, sealing_key in (
        ("other", PIT.public, SEALING),
        ("pit", MAN.public, SEALING),
        ("pit", PIT.public, X25519PrivateKey.generate()),
    ):
        with pytest.raises(ForgedError, match="does not open"):
            open_request(knock, pit, pit_key, sealing_key)


@pytest.mark.parametrize("ephemeral", LOW_ORDER, ids=bytes.hex)
def test_an_answer_to_a_key_of_low_order_is_refused_and_nothing_worse_happens(ephemeral: bytes) -> None:
    with pytest.raises(ForgedError):
        hear(sealed_knock(signed_by(ANN, replace(WHOLE, ephemeral=ephemeral)))).answer(WAIT)


@pytest.mark.parametrize("ephemeral", [b"", bytes(31), b"\x09" + bytes(32)])
def test_a_request_whose_ephemeral_key_is_none_is_refused(ephemeral: bytes) -> None:
    with pytest.raises(ForgedError, match="public key"):
        hear(sealed_knock(signed_by(ANN, replace(WHOLE, ephemeral=ephemeral))))


@pytest.mark.parametrize("enc", LOW_ORDER, ids=bytes.hex)
def test_what_is_sealed_with_a_sender_s_key_of_low_order_does_not_open(enc: bytes) -> None:
    """Who sends such a point knows what the exchange ends at: zero."""
    info = b"arena request\x00pit\x00" + PIT.public
    _, key, nonce = schedule(bytes(32), enc, SEALING_KEY, info)
    sealed = enc + ChaCha20Poly1305(key).encrypt(nonce, signed_by(ANN, WHOLE), b"")

    with pytest.raises(ForgedError):
        hear(encode(SealedRequest(sealed=sealed)))


@pytest.mark.parametrize("entry", [b"", bytes(31), bytes(33), b"\xff" * 32])
def test_a_request_whose_entry_is_no_key_is_refused(entry: bytes) -> None:
    with pytest.raises(ForgedError):
        hear(sealed_knock(signed_by(ANN, replace(WHOLE, entry=entry))))


@pytest.mark.parametrize("message", [ChallengeRequest(), WAIT, CHALLENGE, SealedRequest(sealed=b"x")])
def test_a_signed_message_that_is_no_request_is_refused(message: Message) -> None:
    with pytest.raises(ForgedError, match="no request"):
        hear(sealed_knock(signed_by(ANN, message)))


@pytest.mark.parametrize("message", [ChallengeRequest(), WAIT, CHALLENGE, WHOLE, SealedAnswer(sealed=b"x" * 99)])
def test_what_is_not_sealed_is_no_sealed_request(message: Message) -> None:
    with pytest.raises(ForgedError, match="no sealed request"):
        hear(encode(message))


# Anything at all


KNOCK = ask().sealed
ATTEMPT = ask()
ANSWER = hear(ATTEMPT.sealed).answer(WAIT)


def change(data: bytes, draw: st.DataObject) -> bytes:
    changed = bytearray(data)
    for _ in range(draw.draw(st.integers(1, 3))):
        changed[draw.draw(st.integers(0, len(changed) - 1))] ^= draw.draw(st.integers(1, 255))
    return bytes(changed)


@given(st.data())
def test_a_changed_knock_is_the_other_side_s_fault_and_nothing_worse(draw: st.DataObject) -> None:
    changed = change(KNOCK, draw)

    if changed != KNOCK:
        with pytest.raises(ProtocolError):
            hear(changed)


@given(st.data())
def test_a_changed_answer_is_the_other_side_s_fault_and_nothing_worse(draw: st.DataObject) -> None:
    changed = change(ANSWER, draw)

    if changed != ANSWER:
        with pytest.raises(ProtocolError):
            ATTEMPT.open(changed)
    assert ATTEMPT.open(ANSWER) == WAIT


def test_a_knock_or_an_answer_that_was_cut_is_the_other_side_s_fault() -> None:
    for n_bytes in range(len(KNOCK)):
        with pytest.raises(ProtocolError):
            hear(KNOCK[:n_bytes])
    for n_bytes in range(len(ANSWER)):
        with pytest.raises(ProtocolError):
            ATTEMPT.open(ANSWER[:n_bytes])


@given(st.binary(max_size=200))
def test_any_bytes_and_any_bytes_sealed_are_the_other_side_s_fault_and_nothing_worse(data: bytes) -> None:
    for knock in (data, encode(SealedRequest(sealed=data)), sealed_knock(data), sealed_knock(data + signed_by(ANN, WHOLE)[-64:])):
        with pytest.raises(ProtocolError):
            hear(knock)
    for answer in (data, encode(SealedAnswer(sealed=data))):
        with pytest.raises(ProtocolError):
            ATTEMPT.open(answer)


@given(st.binary(max_size=60).filter(lambda data: data != encode(WAIT)))
def test_any_bytes_sealed_into_an_answer_are_a_message_or_the_pit_s_fault(data: bytes) -> None:
    caller = hear(ATTEMPT.sealed)
    info = b"arena answer\x00" + sha256(caller.sealed).digest() + caller.request.reply_secret
    *_, sealed = plain_encrypt(X25519PrivateKey.generate(), caller.request.ephemeral, info, b"", data)

    with pytest.raises(ProtocolError):
        ATTEMPT.open(encode(SealedAnswer(sealed=sealed)))


def test_a_request_of_another_version_is_unreadable() -> None:
    data = msgpack.packb([PROTOCOL_VERSION + 1, *msgpack.unpackb(encode(WHOLE))[1:]])

    with pytest.raises(ProtocolError, match=f"speaks version {PROTOCOL_VERSION + 1}"):
        hear(sealed_knock(data + ANN.sign("request", data)))


# The seat


def seat_key(pit_key: bytes, match: str, team: Team, direction: Direction, secret: bytes) -> bytes:
    return derive_key(secret, "seat", pit_key, match.encode(), team.name.encode(), direction.value.encode())


@pytest.mark.parametrize("team", Team)
def test_both_sides_meet_in_both_directions(team: Team) -> None:
    attempt = ask()
    from_client, to_client = attempt.sit("m1", team, PIT_SECRET)
    from_pit, to_pit = hear(attempt.sealed).sit("m1", team, PIT_SECRET, 500)

    for tick in range(3):
        shown = from_pit.close(bytes([tick]), tick)
        assert len(shown) == 12 + 500 + 16
        assert to_client.open(shown) == bytes([tick])
        assert to_pit.open(from_client.close(b"orders", tick)) == b"orders"


def test_a_seat_s_keys_are_derived_from_both_secrets_pit_match_team_and_direction() -> None:
    attempt = ask()
    caller = hear(attempt.sealed)
    from_pit, _ = caller.sit("m1", Team.RED, PIT_SECRET, 64)
    from_client, _ = attempt.sit("m1", Team.RED, PIT_SECRET)
    secret = PIT_SECRET + caller.request.reply_secret

    for sealer, direction in ((from_pit, Direction.OBSERVATION), (from_client, Direction.ACTION)):
        key = seat_key(PIT.public, "m1", Team.RED, direction, secret)
        expected = Sealer(key, seat_context("pit", "m1", Team.RED, direction)).close(b"data", 7)
        assert sealer.close(b"data", 7) == expected


def test_a_seat_s_keys_differ_by_pit_match_team_direction_and_either_secret() -> None:
    keys: list[bytes] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sealing, "ChaCha20Poly1305", lambda key: keys.append(key) or ChaCha20Poly1305(key))
        patch.setattr(handshake, "new_secret", lambda: bytes(32))
        for pit in (PIT, MAN):
            attempt = ask(challenge=sign_challenge("pit", pit, SEALING_KEY, NUMBER))
            for match in ("m1", "m2"):
                for team in Team:
                    attempt.sit(match, team, PIT_SECRET)
        attempt.sit("m1", Team.BLUE, bytes(32))
        patch.setattr(handshake, "new_secret", lambda: b"\x01" * 32)
        ask(challenge=sign_challenge("pit", MAN, SEALING_KEY, NUMBER)).sit("m1", Team.BLUE, PIT_SECRET)

    assert len(keys) == len(set(keys)) == 2 * 2 * 2 * 2 + 4


Seat = tuple[Sealer, Opener]


@pytest.mark.parametrize(
    "other",
    [
        lambda caller, _: caller.sit("m2", Team.BLUE, PIT_SECRET, 64),
        lambda caller, _: caller.sit("m1", Team.RED, PIT_SECRET, 64),
        lambda caller, _: caller.sit("m1", Team.BLUE, bytes(32), 64),
        lambda caller, _: replace(caller, pit="pit2").sit("m1", Team.BLUE, PIT_SECRET, 64),
        lambda caller, _: replace(caller, request=replace(caller.request, pit_key=MAN.public)).sit(
            "m1", Team.BLUE, PIT_SECRET, 64
        ),
        lambda caller, _: replace(caller, request=replace(caller.request, reply_secret=bytes(32))).sit(
            "m1", Team.BLUE, PIT_SECRET, 64
        ),
        lambda _, again: again.sit("m1", Team.BLUE, PIT_SECRET, 64),
    ],
)
def test_the_keys_of_another_seat_match_pit_secret_or_request_open_nothing(other: Callable[[Caller, Caller], Seat]) -> None:
    attempt = ask()
    caller = hear(attempt.sealed)
    from_client, to_client = attempt.sit("m1", Team.BLUE, PIT_SECRET)
    from_pit, to_pit = other(caller, hear(ask().sealed))

    with pytest.raises(ForgedError):
        to_client.open(from_pit.close(b"turn", 0))
    with pytest.raises(ForgedError):
        to_pit.open(from_client.close(b"orders", 0))


def test_what_one_side_says_does_not_come_back_to_it_as_the_other_s_word() -> None:
    attempt = ask()
    from_client, to_client = attempt.sit("m1", Team.BLUE, PIT_SECRET)
    from_pit, to_pit = hear(attempt.sealed).sit("m1", Team.BLUE, PIT_SECRET, 64)

    with pytest.raises(ForgedError):
        to_client.open(from_client.close(b"orders", 0))
    with pytest.raises(ForgedError):
        to_pit.open(from_pit.close(b"turn", 0))


def test_who_comes_back_gets_new_keys_and_no_nonce_is_used_twice() -> None:
    """Three joins of one client to one seat, messages both ways: every message has a key and nonce of its own."""
    used: list[tuple[bytes, bytes]] = []

    class Recorder:
        def __init__(self, key: bytes) -> None:
            self.key, self.cipher = key, ChaCha20Poly1305(key)

        def encrypt(self, nonce: bytes, data: bytes, associated: bytes) -> bytes:
            used.append((self.key, nonce))
            return self.cipher.encrypt(nonce, data, associated)

        def decrypt(self, nonce: bytes, data: bytes, associated: bytes) -> bytes:
            return self.cipher.decrypt(nonce, data, associated)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sealing, "ChaCha20Poly1305", Recorder)
        for _ in range(3):
            attempt = ask()
            secret = new_secret()
            from_client, to_client = attempt.sit("m1", Team.BLUE, secret)
            from_pit, to_pit = hear(attempt.sealed).sit("m1", Team.BLUE, secret, 64)
            for tick in range(50):
                to_client.open(from_pit.close(b"turn", tick))
                to_pit.open(from_client.close(b"orders", tick))

    assert len(used) == len(set(used)) == 3 * 50 * 2
    assert len({key for key, _ in used}) == 3 * 2
