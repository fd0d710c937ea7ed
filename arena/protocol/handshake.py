"""How a stranger gets a seat: what is sealed and signed between `ChallengeRequest` and the seat's two keys.

    client                                    pit
    ChallengeRequest ----------------------->
                     <-----------------------  Challenge: the pit's keys and a number of this minute, signed by the pit
    SealedRequest    ----------------------->  a request signed by the entry, sealed to the pit (HPKE, RFC 9180)
                     <-----------------------  SealedAnswer: sealed to a key that only this request knows

Both seal with X25519, HKDF-SHA256 and ChaCha20-Poly1305. The keys of the seat come from a secret of each side, and live as long
as the two processes at most: whoever comes back asks anew.
"""

import secrets
from dataclasses import dataclass, replace
from hashlib import sha256

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.hpke import AEAD, KDF, KEM, Suite

from arena.errors import ForgedError, UnreadableError
from arena.game.types import Team
from arena.protocol.codec import decode, encode
from arena.protocol.identity import SIGNATURE_BYTES, Identity, verify
from arena.protocol.messages import (
    AdminRequest,
    Challenge,
    JoinRequest,
    Message,
    SealedAnswer,
    SealedRequest,
    SeasonRequest,
)
from arena.protocol.sealing import Direction, Opener, Sealer, derive_key, seat_context

SECRET_BYTES = 32
_SUITE = Suite(KEM.X25519, KDF.HKDF_SHA256, AEAD.CHACHA20_POLY1305)
_CHALLENGE, _REQUEST = "challenge", "request"
Request = JoinRequest | AdminRequest | SeasonRequest


def new_secret() -> bytes:
    """Return one side's share of a seat's keys, or a challenge."""
    return secrets.token_bytes(SECRET_BYTES)


def sign_challenge(pit: str, identity: Identity, sealing_key: bytes, number: bytes) -> Challenge:
    """Return what the pit answers to every ChallengeRequest of some seconds."""
    signature = identity.sign(_CHALLENGE, _challenged(pit, sealing_key, number))
    return Challenge(pit_key=identity.public, sealing_key=sealing_key, number=number, signature=signature)


def read_challenge(pit: str, data: bytes) -> Challenge:
    """Return the challenge in a reply; `ProtocolError` if no pit of this name made it. Which pit it is, only the caller knows."""
    challenge = decode(data)
    if not isinstance(challenge, Challenge):
        raise UnreadableError("the pit answers with something else than its keys")
    check_challenge(pit, challenge)
    return challenge


def check_challenge(pit: str, challenge: Challenge) -> None:
    """Check that the pit's own key signed it; whether that is the right pit, only the caller knows."""
    verify(challenge.pit_key, _CHALLENGE, _challenged(pit, challenge.sealing_key, challenge.number), challenge.signature)


def _challenged(pit: str, sealing_key: bytes, number: bytes) -> bytes:
    return b"\0".join((pit.encode(), sealing_key, number))


class Attempt:
    """A client's side of one request."""

    def __init__(self, identity: Identity, pit: str, challenge: Challenge, request: Request) -> None:
        ephemeral = X25519PrivateKey.generate()
        self._ephemeral, self._pit, self.pit_key = ephemeral, pit, challenge.pit_key
        self._secret = new_secret()
        signed = encode(
            replace(
                request,
                entry=identity.public,
                ephemeral=ephemeral.public_key().public_bytes_raw(),
                reply_secret=self._secret,
                challenge=challenge.number,
                pit_key=challenge.pit_key,
            )
        )
        info = _request_info(pit, challenge.pit_key)
        sealed = _seal(signed + identity.sign(_REQUEST, signed), challenge.sealing_key, info)
        self.sealed = encode(SealedRequest(sealed=sealed))
        """What goes to the pit."""
        self._info = _answer_info(sealed, self._secret)

    def open(self, data: bytes) -> Message:
        """Return what the pit answered.

        Raises
        ------
        ForgedError
            Another than the pit answered, or to another request.
        """
        answer = decode(data)
        if not isinstance(answer, SealedAnswer):
            raise ForgedError("an answer is not sealed")
        try:
            return decode(_SUITE.decrypt(answer.sealed, self._ephemeral, self._info))
        except (InvalidTag, ValueError) as error:
            raise ForgedError("an answer does not open") from error

    def sit(self, match: str, team: Team, secret: bytes) -> tuple[Sealer, Opener]:
        """Return how the client seals its orders and opens its observations; `secret` is the ticket's."""
        make = _SeatKeys(self._pit, self.pit_key, match, team, secret + self._secret)
        return make.sealer(Direction.ACTION), make.opener(Direction.OBSERVATION)


@dataclass(frozen=True, slots=True)
class Caller:
    """The pit's side of one request that was opened, and whose signature holds."""

    request: Request
    sealed: bytes
    pit: str

    def answer(self, message: Message) -> bytes:
        """Return the answer, for this caller alone; `ForgedError` if its key is one that nothing can be sealed to."""
        info = _answer_info(self.sealed, self.request.reply_secret)
        return encode(SealedAnswer(sealed=_seal(encode(message), self.request.ephemeral, info)))

    def sit(self, match: str, team: Team, secret: bytes, multiple: int) -> tuple[Sealer, Opener]:
        """Return how the pit seals observations, each `multiple` bytes long, and opens orders."""
        make = _SeatKeys(self.pit, self.request.pit_key, match, team, secret + self.request.reply_secret)
        return make.sealer(Direction.OBSERVATION, multiple), make.opener(Direction.ACTION)


def open_request(data: bytes, pit: str, pit_key: bytes, sealing_key: X25519PrivateKey) -> Caller:
    """Return who sent a request.

    Raises
    ------
    ProtocolError
        It cannot be read, was sealed to another pit, or was not signed by the entry that it names.
    """
    envelope = decode(data)
    if not isinstance(envelope, SealedRequest):
        raise ForgedError("this is no sealed request")
    try:
        opened = _SUITE.decrypt(envelope.sealed, sealing_key, _request_info(pit, pit_key))
    except (InvalidTag, ValueError) as error:
        raise ForgedError("a request does not open: it was sealed to another pit, or to this one before it started") from error
    signed, signature = opened[:-SIGNATURE_BYTES], opened[-SIGNATURE_BYTES:]
    request = decode(signed)
    if not isinstance(request, Request) or request.pit_key != pit_key:
        raise ForgedError("what was sealed is no request to this pit")
    verify(request.entry, _REQUEST, signed, signature)
    _public(request.ephemeral)
    return Caller(request, envelope.sealed, pit)


@dataclass(frozen=True, slots=True)
class _SeatKeys:
    """Makes the two keys of a seat."""

    pit: str
    pit_key: bytes
    match: str
    team: Team
    secret: bytes

    def _key(self, direction: Direction) -> bytes:
        parts = (self.pit_key, self.match.encode(), self.team.name.encode(), direction.value.encode())
        return derive_key(self.secret, "seat", *parts)

    def sealer(self, direction: Direction, *multiple: int) -> Sealer:
        return Sealer(self._key(direction), seat_context(self.pit, self.match, self.team, direction), *multiple)

    def opener(self, direction: Direction) -> Opener:
        return Opener(self._key(direction), seat_context(self.pit, self.match, self.team, direction))


def _public(key: bytes) -> X25519PublicKey:
    try:
        return X25519PublicKey.from_public_bytes(key)
    except ValueError as error:
        raise ForgedError("a public key is none") from error


def _seal(data: bytes, key: bytes, info: bytes) -> bytes:
    try:
        return _SUITE.encrypt(data, _public(key), info)
    except ValueError as error:  # a point of low order, which everybody shares a secret with
        raise ForgedError("nothing can be sealed to a public key that is of low order") from error


def _request_info(pit: str, pit_key: bytes) -> bytes:
    return b"arena request\0" + pit.encode() + b"\0" + pit_key


def _answer_info(sealed: bytes, secret: bytes) -> bytes:
    return b"arena answer\0" + sha256(sealed).digest() + secret
