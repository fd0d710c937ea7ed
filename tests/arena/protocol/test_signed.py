"""What is said for good: the signed bytes are those documented, and hold for nothing else."""

from dataclasses import replace
from hashlib import sha256

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ForgedError, ProtocolError
from arena.game.keys import MatchKeys
from arena.game.types import Team
from arena.protocol.codec import decode, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Ended, Lobby, Orders, Signed
from arena.protocol.signed import (
    STATEMENT_VERSION,
    Statement,
    check_journal,
    check_receipt,
    commit,
    read_statement,
    sign_journal,
    sign_receipt,
    sign_statement,
)

PIT = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32))))
ANN = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32, 64))))
KEYS = MatchKeys(map_key=bytes(range(64, 96)), match_key=bytes(range(96, 128)))
HEAD = bytes(range(128, 160))
FACTS: list[Statement] = [
    Commitment(match="m1", digest=commit("m1", KEYS)),
    Ended(match="m1", ending="capture", winner="BLUE", score=100, ticks=7, reason=""),
    Lobby(pit="p", rules="paper", rules_hash="h", ruleset={}, needs_invite=False, n_begun=0, running=[], waiting=[]),
]


def plain_verify(identity: Identity, data: bytes, signature: bytes) -> None:
    """Verify with nothing of the arena's in between."""
    Ed25519PublicKey.from_public_bytes(identity.public).verify(signature, data)


def test_a_commitment_is_sha256_of_label_match_and_both_keys() -> None:
    digest = commit("m1", KEYS)

    assert digest == sha256(b"arena commitment\x00" + b"m1" + b"\x00" + bytes(range(64, 96)) + bytes(range(96, 128))).digest()
    assert digest.hex() == "7cc059eb3626cc4972e99d4beff6fa17398c0d499e5a7b2f5745b4f183f61d22"


@pytest.mark.parametrize(
    ("match", "keys"),
    [
        ("m2", KEYS),
        ("m1", KEYS._replace(map_key=bytes(32))),
        ("m1", KEYS._replace(match_key=bytes(32))),
        ("m1", MatchKeys(map_key=KEYS.match_key, match_key=KEYS.map_key)),
    ],
)
def test_a_commitment_is_of_one_match_and_its_two_keys(match: str, keys: MatchKeys) -> None:
    assert commit(match, keys) != commit("m1", KEYS)


@pytest.mark.parametrize("fact", FACTS)
def test_a_fact_is_signed_with_plain_ed25519_under_its_label(fact: Statement) -> None:
    signed = sign_statement(PIT, fact)

    assert decode(signed.data, STATEMENT_VERSION) == fact
    plain_verify(PIT, b"arena fact\x00" + signed.data, signed.signature)
    assert read_statement(signed, PIT.public) == fact


@pytest.mark.parametrize("fact", FACTS)
def test_a_fact_that_another_signed_is_refused(fact: Statement) -> None:
    with pytest.raises(ForgedError):
        read_statement(sign_statement(ANN, fact), PIT.public)


def test_the_signature_of_one_fact_holds_for_no_other() -> None:
    won, lost = FACTS[1], replace(FACTS[1], winner="RED")

    with pytest.raises(ForgedError):
        read_statement(replace(sign_statement(PIT, won), data=encode(lost)), PIT.public)


@given(st.sampled_from(FACTS), st.booleans(), st.integers(0), st.integers(1, 255))
def test_a_fact_that_was_changed_is_refused(fact: Statement, is_data: bool, at: int, change: int) -> None:
    name = "data" if is_data else "signature"
    signed = sign_statement(PIT, fact)
    changed = bytearray(getattr(signed, name))
    changed[at % len(changed)] ^= change

    with pytest.raises(ForgedError):
        read_statement(replace(signed, **{name: bytes(changed)}), PIT.public)


def test_a_message_that_is_no_fact_is_none_though_the_pit_signed_it() -> None:
    data = encode(Orders(tick=1, actions=b""), STATEMENT_VERSION)

    with pytest.raises(ForgedError, match="no fact"):
        read_statement(Signed(data=data, signature=PIT.sign("fact", data)), PIT.public)


def test_a_signed_thing_that_is_no_message_is_unreadable() -> None:
    with pytest.raises(ProtocolError):
        read_statement(Signed(data=b"nothing", signature=PIT.sign("fact", b"nothing")), PIT.public)


@pytest.mark.parametrize("label", ["request", "receipt", "journal", "challenge"])
def test_what_was_signed_as_something_else_is_no_fact(label: str) -> None:
    data = encode(FACTS[0])

    with pytest.raises(ForgedError):
        read_statement(Signed(data=data, signature=PIT.sign(label, data)), PIT.public)


@pytest.mark.parametrize("team", Team)
def test_a_receipt_is_signed_with_plain_ed25519_over_match_team_number_and_head(team: Team) -> None:
    receipt = sign_receipt(ANN, "m1", team, 12, HEAD)

    assert (receipt.n_shown, receipt.head) == (12, HEAD)
    plain_verify(ANN, b"arena receipt\x00m1\x00" + team.name.encode() + b"\x0012\x00" + HEAD, receipt.signature)
    check_receipt(ANN.public, "m1", team, receipt)


def test_a_receipt_holds_for_one_entry_match_team_number_and_head_only() -> None:
    receipt = sign_receipt(ANN, "m1", Team.BLUE, 12, HEAD)

    for entry, match, team, shown in (
        (PIT.public, "m1", Team.BLUE, receipt),
        (ANN.public, "m2", Team.BLUE, receipt),
        (ANN.public, "m1", Team.RED, receipt),
        (ANN.public, "m1", Team.BLUE, replace(receipt, n_shown=13)),
        (ANN.public, "m1", Team.BLUE, replace(receipt, n_shown=1, head=b"2\x00" + HEAD)),
        (ANN.public, "m1", Team.BLUE, replace(receipt, head=bytes(32))),
        (ANN.public, "m1", Team.BLUE, replace(receipt, head=HEAD[:-1])),
        (ANN.public, "m1", Team.BLUE, replace(receipt, signature=bytes(64))),
        (ANN.public, "m1", Team.BLUE, replace(receipt, signature=b"")),
    ):
        with pytest.raises(ForgedError, match="receipt"):
            check_receipt(entry, match, team, shown)


def test_a_journal_is_signed_with_plain_ed25519_over_its_hash() -> None:
    signature = sign_journal(PIT, HEAD)

    plain_verify(PIT, b"arena journal\x00" + HEAD, signature)
    check_journal(PIT.public, HEAD, signature)


def test_a_journal_s_signature_holds_for_one_pit_and_one_journal_only() -> None:
    signature = sign_journal(PIT, HEAD)

    for pit_key, canonical_hash, shown in (
        (ANN.public, HEAD, signature),
        (PIT.public, bytes(32), signature),
        (PIT.public, HEAD, PIT.sign("fact", HEAD)),
        (PIT.public, HEAD, b""),
    ):
        with pytest.raises(ForgedError, match="journal"):
            check_journal(pit_key, canonical_hash, shown)
