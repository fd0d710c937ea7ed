"""The test vectors of the protocol, docs/reference/zenoh-vectors.json: made by the arena, and followed here as a stranger would.

Those who follow have msgpack, Ed25519, X25519, HKDF, HPKE and ChaCha20-Poly1305, and nothing of ours. What is sealed to a public
key is another at each time, so the two such vectors are kept as long as they open.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from struct import unpack_from
from typing import Any, get_args

import msgpack
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.hpke import AEAD, KDF, KEM, Suite
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from protocol_examples import ANN, MATCH, MESSAGES, PIT, SEALING, A, B, C
from worlds import lay

from arena.errors import ProtocolError
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset, to_dict
from arena.game.types import Team
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Caller, open_request, sign_challenge
from arena.protocol.messages import PROTOCOL_VERSION, Commitment, JoinRequest, Message, SealedAnswer, SealedRequest
from arena.protocol.observation_codec import ObservationWriter
from arena.protocol.sealing import Direction, Sealer, seat_context
from arena.protocol.signed import STATEMENT_VERSION, commit, sign_receipt, sign_statement
from arena.records.transcript import Head

FILE = Path(__file__).parents[2] / "docs" / "reference" / "zenoh-vectors.json"
EPHEMERAL = X25519PrivateKey.from_private_bytes(bytes([5]) * 32)
SUITE = Suite(KEM.X25519, KDF.HKDF_SHA256, AEAD.CHACHA20_POLY1305)
LANE = 7
PADDING = b"\x80"


# What the arena says


def plain(value: Any) -> Any:
    """Return a value as JSON holds it; bytes as {"hex": ...}."""
    if isinstance(value, bytes):
        return {"hex": value.hex()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return {key: plain(one) for key, one in value.items()} if isinstance(value, dict) else value


def make_messages() -> list[dict[str, Any]]:
    kinds: tuple[type, ...] = get_args(Message)
    every = [message for messages in MESSAGES.values() for message in messages]
    return [
        {
            "kind": kinds.index(type(one)),
            "name": type(one).__name__,
            "fields": plain(msgpack.unpackb(encode(one))[2:]),
            "bytes": encode(one).hex(),
        }
        for one in sorted(every, key=lambda one: kinds.index(type(one)))
    ]


def make_topics() -> dict[str, str]:
    keys = {name: getattr(topics, name)("pit") for name in ("join", "lobby", "submissions")}
    for team in (*Team, None):
        for name in ("observation", "action"):
            keys[f"{name} of {'bundles' if team is None else team.name.lower()}"] = getattr(topics, name)("pit", LANE, team)
    keys |= {name: getattr(topics, name)("pit", MATCH) for name in ("public", "truth", "delayed", "journal")}
    return keys | {"presence": topics.presence("pit", "ann", "c-1")}


def make_handshake(kept: dict[str, Any]) -> dict[str, Any]:
    """Return a challenge, a request and an answer; the sealed ones are those that were kept, if they open."""
    challenge = sign_challenge("pit", PIT, SEALING.public_key().public_bytes_raw(), C)
    request = replace(
        JoinRequest(rules_version=1, name="ann", team="any", client="c-1", slot=0),
        entry=ANN.public, ephemeral=EPHEMERAL.public_key().public_bytes_raw(), reply_secret=A, challenge=C, pit_key=PIT.public,
    )  # fmt: skip
    signed = encode(request)
    asked = signed + ANN.sign("request", signed)
    try:
        sealed = bytes.fromhex(kept["sealed request"])
        assert open_request(encode(SealedRequest(sealed=sealed)), "pit", PIT.public, SEALING).request == request
        answer = bytes.fromhex(kept["sealed answer"])
        SUITE.decrypt(answer, EPHEMERAL, answer_info(sealed, A))
    except (KeyError, ProtocolError):
        sealed = SUITE.encrypt(asked, SEALING.public_key(), request_info("pit", PIT.public))
        caller = open_request(encode(SealedRequest(sealed=sealed)), "pit", PIT.public, SEALING)
        assert isinstance(caller, Caller)
        [ticket, *_] = MESSAGES["a seat"]
        told = decode(caller.answer(ticket))
        assert isinstance(told, SealedAnswer)
        answer = told.sealed
    return {
        "challenge": encode(challenge).hex(),
        "request and signature": asked.hex(),
        "sealed request": sealed.hex(),
        "sealed answer": answer.hex(),
        "answer": encode(MESSAGES["a seat"][0]).hex(),
    }


def make_seat() -> list[dict[str, Any]]:
    """Return what each direction of each seat seals: the pit's secret is B, the client's A."""
    told = []
    request = JoinRequest(rules_version=1, name="ann", team="any", client="c-1", slot=0, reply_secret=A, pit_key=PIT.public)
    for team in Team:
        observations, _ = Caller(request, b"", "pit").sit(MATCH, team, B, 128)
        sealed = [observations.close(data, tick).hex() for tick, data in ((0, b"one"), (0, b"two"), (70_000, bytes(128)))]
        context = seat_context("pit", MATCH, team, Direction.OBSERVATION).decode()
        told.append({"team": team.name, "direction": "observation", "multiple": 128, "context": context, "sealed": sealed})
    return told


def make_statements() -> dict[str, Any]:
    keys = MatchKeys(map_key=A, match_key=B)
    commitment = sign_statement(PIT, Commitment(match=MATCH, digest=commit(MATCH, keys)))
    return {
        "version": STATEMENT_VERSION,
        "map key": A.hex(),
        "match key": B.hex(),
        "digest": commit(MATCH, keys).hex(),
        "commitment": commitment.data.hex(),
        "signature of the commitment": commitment.signature.hex(),
        "receipt": encode(sign_receipt(ANN, MATCH, Team.RED, 101, C)).hex(),
    }


def make_observations(rules: Ruleset) -> dict[str, Any]:
    """Return what blue is shown before and after one tick, and the head of a transcript after each."""
    games, shown, heads, head = lay(rules), [], [], Head()
    for _ in range(2):
        shown.append(ObservationWriter(games.observe()[Team.BLUE], 0).write())
        head.add(shown[-1])
        heads.append(head.digest.hex())
        games.step(bytearray_of_stays(rules))
    return {"ruleset": to_dict(rules), "team": "blue", "shown": [one.hex() for one in shown], "heads": heads}


def bytearray_of_stays(rules: Ruleset) -> Any:
    import numpy as np

    return np.zeros((1, sum(len(rules.team(team)) for team in Team)), np.int8)


@pytest.fixture(scope="module")
def made(small_rules: Ruleset) -> str:
    kept = json.loads(FILE.read_text())["handshake"] if FILE.is_file() else {}
    told = {
        "version": PROTOCOL_VERSION,
        "private keys": {
            "pit": (bytes([1]) * 32).hex(),
            "ann": (bytes([2]) * 32).hex(),
            "sealing": (bytes([4]) * 32).hex(),
            "ephemeral": (bytes([5]) * 32).hex(),
        },
        "public keys": {"pit": PIT.public.hex(), "pit as text": PIT.fingerprint, "ann": ANN.public.hex()},
        "secrets": {"client": A.hex(), "pit": B.hex(), "number": C.hex()},
        "topics": make_topics(),
        "messages": make_messages(),
        "signature": {"label": "label", "data": b"data".hex(), "signature": PIT.sign("label", b"data").hex()},
        "handshake": make_handshake(kept),
        "seats": make_seat(),
        "statements": make_statements(),
        "observations": make_observations(small_rules),
    }
    return json.dumps(told, indent=1) + "\n"


def test_the_vectors_are_what_the_arena_says(same: Callable[[str, str], None], made: str) -> None:
    same(str(FILE), made)


# What a stranger makes of it, by docs/reference/zenoh.md


@cache
def vectors() -> dict[str, Any]:
    return json.loads(FILE.read_text())  # type: ignore[no-any-return]


def hexed(*path: str) -> bytes:
    value: Any = vectors()
    for name in path:
        value = value[name]
    return bytes.fromhex(value)


def request_info(pit: str, pit_key: bytes) -> bytes:
    return b"arena request\0" + pit.encode() + b"\0" + pit_key


def answer_info(sealed: bytes, secret: bytes) -> bytes:
    return b"arena answer\0" + sha256(sealed).digest() + secret


def derive(secret: bytes, *parts: bytes) -> bytes:
    info = b"".join(len(part).to_bytes(4, "big") + part for part in parts)
    return HKDF(algorithm=SHA256(), length=32, salt=None, info=info).derive(secret)


def check(public: bytes, label: str, data: bytes, signature: bytes) -> None:
    Ed25519PublicKey.from_public_bytes(public).verify(signature, b"arena " + label.encode() + b"\0" + data)


def raw(value: Any) -> Any:
    if isinstance(value, dict):
        return bytes.fromhex(value["hex"]) if value.keys() == {"hex"} else {key: raw(one) for key, one in value.items()}
    return [raw(one) for one in value] if isinstance(value, list) else value


def test_a_message_is_an_array_of_the_version_the_kind_and_the_fields() -> None:
    for message in vectors()["messages"]:
        assert msgpack.packb([vectors()["version"], message["kind"], *raw(message["fields"])]).hex() == message["bytes"]


def test_a_signature_is_of_the_label_and_the_data() -> None:
    key = Ed25519PrivateKey.from_private_bytes(hexed("private keys", "pit"))

    assert key.public_key().public_bytes_raw() == hexed("public keys", "pit")
    assert key.sign(b"arena label\0data") == hexed("signature", "signature")


def test_a_seat_is_asked_for_and_given() -> None:
    _, kind, pit_key, sealing_key, number, signature = msgpack.unpackb(hexed("handshake", "challenge"))
    assert kind == 1
    assert number == hexed("secrets", "number")
    check(pit_key, "challenge", b"pit\0" + sealing_key + b"\0" + number, signature)

    private = X25519PrivateKey.from_private_bytes(hexed("private keys", "sealing"))
    sealed = hexed("handshake", "sealed request")
    asked = SUITE.decrypt(sealed, private, request_info("pit", pit_key))
    assert asked == hexed("handshake", "request and signature")
    check(hexed("public keys", "ann"), "request", asked[:-64], asked[-64:])

    ephemeral = X25519PrivateKey.from_private_bytes(hexed("private keys", "ephemeral"))
    answer = SUITE.decrypt(hexed("handshake", "sealed answer"), ephemeral, answer_info(sealed, hexed("secrets", "client")))
    assert answer == hexed("handshake", "answer")


def test_a_seat_s_messages_open() -> None:
    both = hexed("secrets", "pit") + hexed("secrets", "client")
    for seat in vectors()["seats"]:
        parts = hexed("public keys", "pit"), MATCH.encode(), seat["team"].encode(), seat["direction"].encode()
        cipher = ChaCha20Poly1305(derive(both, b"arena seat", *parts))
        opened = []
        for count, sealed in enumerate(map(bytes.fromhex, seat["sealed"])):
            assert int.from_bytes(sealed[:8], "big") == count
            padded = cipher.decrypt(bytes(4) + sealed[:8], sealed[12:], seat["context"].encode() + sealed[8:12])
            assert len(padded) % seat["multiple"] == 0
            opened.append((int.from_bytes(sealed[8:12], "big"), padded.rstrip(b"\0").removesuffix(PADDING)))
        assert opened == [(0, b"one"), (0, b"two"), (70_000, bytes(128))]


def test_what_is_signed_for_good_holds() -> None:
    digest = sha256(
        b"arena commitment\0" + MATCH.encode() + b"\0" + hexed("statements", "map key") + hexed("statements", "match key")
    ).digest()
    commitment = msgpack.packb([vectors()["statements"]["version"], 16, MATCH, digest])
    assert commitment == hexed("statements", "commitment")
    check(hexed("public keys", "pit"), "fact", commitment, hexed("statements", "signature of the commitment"))

    _, _, n_shown, head, signature = msgpack.unpackb(hexed("statements", "receipt"))
    check(hexed("public keys", "ann"), "receipt", b"\0".join((MATCH.encode(), b"RED", str(n_shown).encode(), head)), signature)


def test_an_observation_is_laid_out_as_the_page_says() -> None:
    told = vectors()["observations"]
    side, head = told["ruleset"]["side"], bytes(32)
    for tick, (shown, after) in enumerate(zip(map(bytes.fromhex, told["shown"]), told["heads"], strict=True)):
        assert len(shown) == 8 + 4 + 4 + 2 + 4 + 4 + 4 + 2 + 2 + side * side
        _, now, clock, score, own, enemy, *_ = unpack_from("<QiIhhh", shown)
        assert (now, clock, score, own, enemy) == (tick, 0xFFFFFFFF, 0, 2, 2)
        head = sha256(head + shown[:12] + b"\xff" * 4 + shown[16:]).digest()
        assert head.hex() == after


def test_the_topics_are_those_of_the_page() -> None:
    page = (FILE.parent / "zenoh.md").read_text()

    for topic in vectors()["topics"].values():
        pattern = (
            topic.replace("/pit/", "/PIT/").replace("/7/", "/LANE/").replace(MATCH, "MATCH").replace("ann/c-1", "NAME/CLIENT")
        )
        assert pattern.replace("blue", "TEAM").replace("red", "TEAM") in page


def test_a_sealer_s_bytes_are_those_of_the_vectors() -> None:
    """The first of a key's messages, made here."""
    [blue, _] = vectors()["seats"]
    parts = hexed("public keys", "pit"), MATCH.encode(), b"BLUE", b"observation"
    key = derive(hexed("secrets", "pit") + hexed("secrets", "client"), b"arena seat", *parts)

    assert Sealer(key, blue["context"].encode(), blue["multiple"]).close(b"one", 0).hex() == blue["sealed"][0]
