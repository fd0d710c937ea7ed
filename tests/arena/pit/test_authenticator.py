"""The authenticator: each request opens once, for as long as its challenge is young, and what is remembered of it is bounded."""

from dataclasses import replace

import msgpack
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from arena.errors import ForgedError, ProtocolError, UnreadableError
from arena.pit import authenticator as module
from arena.pit.authenticator import EPOCH_S, Authenticator
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, check_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import AdminRequest, Challenge, JoinRequest, Wait

ANN = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32))))
PIT = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32, 64))))
JOIN = JoinRequest(rules_version=1, name="ann", team="any", client="c", slot=0)


@pytest.fixture
def authenticator() -> Authenticator:
    return Authenticator("pit", PIT)


def challenge_of(authenticator: Authenticator, now_s: float) -> Challenge:
    challenge = decode(authenticator.challenge(now_s))
    assert isinstance(challenge, Challenge)
    return challenge


def ask(authenticator: Authenticator, now_s: float, identity: Identity = ANN) -> Attempt:
    return Attempt(identity, "pit", challenge_of(authenticator, now_s), JOIN)


def test_a_request_opens_and_its_caller_can_open_the_answer(authenticator: Authenticator) -> None:
    attempt = ask(authenticator, 0.0)

    caller = authenticator.open(attempt.sealed, 1.0)

    assert isinstance(caller.request, JoinRequest)
    assert (caller.request.name, caller.request.entry) == ("ann", ANN.public)
    assert attempt.open(caller.answer(Wait(reason="x"))) == Wait(reason="x")


def test_an_operator_s_request_opens_once_too(authenticator: Authenticator) -> None:
    sealed = Attempt(PIT, "pit", challenge_of(authenticator, 0.0), AdminRequest(command="ban", target="ann")).sealed

    assert authenticator.open(sealed, 0.0).request.entry == PIT.public
    with pytest.raises(ForgedError, match="second time"):
        authenticator.open(sealed, 0.0)


@pytest.mark.parametrize("again_s", [0.0, 1.0, EPOCH_S - 0.01, EPOCH_S, 2 * EPOCH_S - 0.01])
def test_a_request_opens_once(authenticator: Authenticator, again_s: float) -> None:
    sealed = ask(authenticator, 0.0).sealed
    authenticator.open(sealed, 0.0)

    with pytest.raises(ForgedError, match="second time"):
        authenticator.open(sealed, again_s)


def test_a_request_can_at_no_time_be_opened_again(authenticator: Authenticator) -> None:
    sealed = ask(authenticator, 0.0).sealed
    authenticator.open(sealed, 0.0)

    for step in range(1, 200):
        with pytest.raises(ForgedError):
            authenticator.open(sealed, step * EPOCH_S / 20)


def test_a_request_in_other_bytes_is_still_the_same_request(authenticator: Authenticator) -> None:
    """Msgpack can be written in more than one way."""
    request = ask(authenticator, 0.0).sealed
    version, kind, sealed = msgpack.unpackb(request)
    other = b"\xdc\x00\x03" + msgpack.packb(version) + msgpack.packb(kind) + b"\xc6" + len(sealed).to_bytes(4, "big") + sealed
    authenticator.open(other, 0.0)

    assert other != request
    with pytest.raises(ForgedError, match="second time"):
        authenticator.open(request, 0.0)


def test_two_requests_of_one_client_in_one_epoch_are_two(authenticator: Authenticator) -> None:
    authenticator.open(ask(authenticator, 0.0).sealed, 0.0)
    authenticator.open(ask(authenticator, 0.0).sealed, 0.0)


def test_a_request_that_was_changed_on_its_way_takes_nothing_from_the_genuine_one(authenticator: Authenticator) -> None:
    sealed = ask(authenticator, 0.0).sealed
    for at in range(0, len(sealed), 7):
        with pytest.raises(ProtocolError):
            authenticator.open(sealed[:at] + bytes([sealed[at] ^ 1]) + sealed[at + 1 :], 0.0)

    authenticator.open(sealed, 0.0)


# Challenges


def test_a_challenge_is_the_pit_s_own_and_holds_for_an_epoch(authenticator: Authenticator) -> None:
    first = challenge_of(authenticator, 100.0)

    check_challenge("pit", first)
    assert first.pit_key == PIT.public
    assert challenge_of(authenticator, 100.0 + EPOCH_S - 0.01) == first
    second = challenge_of(authenticator, 100.0 + EPOCH_S)
    check_challenge("pit", second)
    assert second.number != first.number
    assert second.sealing_key == first.sealing_key


def test_numbers_are_32_bytes_and_never_the_same(authenticator: Authenticator) -> None:
    numbers = [challenge_of(authenticator, epoch * EPOCH_S).number for epoch in range(50)]

    assert len(set(numbers)) == 50
    assert {len(number) for number in numbers} == {32}


@pytest.mark.parametrize("now_s", [0.0, 1.0, EPOCH_S, EPOCH_S + 1, 2 * EPOCH_S - 0.01])
def test_a_challenge_is_taken_in_its_epoch_and_in_the_next(authenticator: Authenticator, now_s: float) -> None:
    authenticator.open(ask(authenticator, 0.0).sealed, now_s)


def is_too_old(authenticator: Authenticator, sealed: bytes, now_s: float) -> None:
    with pytest.raises(ForgedError, match="no challenge of the last seconds"):
        authenticator.open(sealed, now_s)


def test_a_challenge_of_two_epochs_ago_is_refused(authenticator: Authenticator) -> None:
    sealed = ask(authenticator, 0.0).sealed
    authenticator.challenge(EPOCH_S)
    authenticator.challenge(2 * EPOCH_S)

    is_too_old(authenticator, sealed, 2 * EPOCH_S)


@pytest.mark.parametrize("now_s", [2 * EPOCH_S, 2 * EPOCH_S + 0.01, 3 * EPOCH_S, 1e6])
def test_an_old_challenge_is_refused_though_nobody_asked_for_another_since(authenticator: Authenticator, now_s: float) -> None:
    is_too_old(authenticator, ask(authenticator, 0.0).sealed, now_s)


def test_a_challenge_that_the_pit_never_gave_is_refused(authenticator: Authenticator) -> None:
    """The entry signs it itself: a request cannot be made before its time."""
    challenge = challenge_of(authenticator, 0.0)

    is_too_old(authenticator, Attempt(ANN, "pit", replace(challenge, number=bytes(32)), JOIN).sealed, 0.0)


def test_a_clock_that_starts_anywhere_will_do() -> None:
    for start_s in (0.0, 12.5, 1e7):
        authenticator = Authenticator("pit", PIT)
        authenticator.open(ask(authenticator, start_s).sealed, start_s + 1)


def test_a_request_to_the_pit_before_it_started_again_is_refused(authenticator: Authenticator) -> None:
    again = Authenticator("pit", PIT)
    again.challenge(0.0)

    with pytest.raises(ForgedError, match="to this one before it started"):
        again.open(ask(authenticator, 0.0).sealed, 0.0)
    assert challenge_of(again, 0.0).sealing_key != challenge_of(authenticator, 0.0).sealing_key


@pytest.mark.parametrize(
    ("payload", "error"),
    [(b"", UnreadableError), (b"x" * 70_000, UnreadableError), (encode(Wait(reason="x")), ForgedError)],
)
def test_what_is_no_sealed_request_is_refused(authenticator: Authenticator, payload: bytes, error: type[ProtocolError]) -> None:
    with pytest.raises(error):
        authenticator.open(payload, 0.0)


# Memory


def test_beyond_a_number_of_requests_none_is_taken_until_the_next_epoch(
    authenticator: Authenticator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_USED", 3)
    for _ in range(3):
        authenticator.open(ask(authenticator, 0.0).sealed, 0.0)
    late = ask(authenticator, 0.0).sealed

    with pytest.raises(ForgedError, match="too many requests"):
        authenticator.open(late, 0.0)
    with pytest.raises(ForgedError, match="too many requests"):
        authenticator.open(late, EPOCH_S)
    authenticator.open(ask(authenticator, EPOCH_S).sealed, EPOCH_S)


def test_what_is_remembered_is_bounded(authenticator: Authenticator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_USED", 3)
    opened = 0

    for epoch in range(20):
        for _ in range(5):
            try:
                authenticator.open(ask(authenticator, epoch * EPOCH_S).sealed, epoch * EPOCH_S)
                opened += 1
            except ForgedError:
                pass
            assert len(authenticator._used) <= 2
            assert sum(map(len, authenticator._used.values())) <= 2 * 3

    assert opened == 20 * 3


def test_refused_requests_are_not_remembered(authenticator: Authenticator) -> None:
    elsewhere = ask(Authenticator("pit", PIT), 0.0).sealed
    authenticator.challenge(0.0)

    for payload in (b"", elsewhere, encode(Wait(reason="x"))):
        with pytest.raises(ProtocolError):
            authenticator.open(payload, 0.0)

    assert sum(map(len, authenticator._used.values())) == 0
