"""The seam through which every message of a seat passes on its way to bytes on the network, and back.

    counter uint64 | tick uint32 | ChaCha20-Poly1305(padded message)          integers are big-endian

The nonce is the counter: of messages sent under this key, never the tick. What else the message must not be moved between is
authenticated beside it: version, pit, match, seat, direction, tick. So a replayed, reordered, forged or moved message does not
open. A key belongs to one seat, one direction and one process on either side, and is never written down; see `handshake`.
"""

import struct
from enum import Enum

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from arena.errors import ForgedError, ReplayedError
from arena.game.types import Team
from arena.protocol.messages import PROTOCOL_VERSION

KEY_BYTES = 32
PAD_BYTES = 64
"""Orders, and all else that has no size of its own, come in multiples of this."""
_HEAD = struct.Struct(">QI")
_PREFIX = bytes(4)
"""Of each nonce, before the counter."""
_TAG_BYTES = 16


class Direction(Enum):
    """Which way a key's messages go."""

    OBSERVATION = "observation"
    ACTION = "action"


def derive_key(secret: bytes, label: str, *parts: bytes) -> bytes:
    """Return 32 bytes by HKDF-SHA256 (RFC 5869) under a label and what the key is for, each part behind its length."""
    info = b"".join(len(part).to_bytes(4, "big") + part for part in (b"arena " + label.encode(), *parts))
    return HKDF(algorithm=SHA256(), length=KEY_BYTES, salt=None, info=info).derive(secret)


def seat_context(pit: str, match: str, team: Team, direction: Direction) -> bytes:
    """Return what authenticates the place of a message, its tick apart."""
    return f"arena {PROTOCOL_VERSION}/{pit}/{match}/{team.name}/{direction.value}/".encode()


def pad(data: bytes, multiple: int) -> bytes:
    """Return `data` lengthened to a multiple; ISO/IEC 7816-4."""
    n_bytes = len(data) + 1
    return (data + b"\x80").ljust(n_bytes + -n_bytes % multiple, b"\0")


def unpad(data: bytes) -> bytes:
    """Return what was padded."""
    bare = data.rstrip(b"\0")
    if bare[-1:] != b"\x80":
        raise ForgedError("a message lacks its padding")
    return bare[:-1]


class Sealer:
    """Seals one direction; no counter is used twice."""

    def __init__(self, key: bytes, context: bytes, multiple: int = PAD_BYTES) -> None:
        self._cipher, self._context, self._multiple = ChaCha20Poly1305(key), context, multiple
        self._count = 0

    def close(self, data: bytes, tick: int) -> bytes:
        """Return what goes over the network. To send a thing again, send these bytes again."""
        count = self._count
        self._count += 1
        head = _HEAD.pack(count, tick)
        return head + self._cipher.encrypt(_PREFIX + head[:8], pad(data, self._multiple), self._context + head[8:])


class Opener:
    """Opens what the other side's `Sealer` closed, each message once, in the order of their counters."""

    def __init__(self, key: bytes, context: bytes) -> None:
        self._cipher, self._context = ChaCha20Poly1305(key), context
        self._last, self._last_bytes = b"", b""

    def open(self, data: bytes) -> bytes:
        """Return the message; the last one may come again, as it was.

        Raises
        ------
        ForgedError
            It was made, changed or moved by another than the holder of the key.
        ReplayedError
            It is genuine, and of a counter that was passed.
        """
        padded = self._decrypt(data)
        count = data[:8]  # big-endian: bytes of one length are in the order of what they count
        if count <= self._last and (count != self._last or data != self._last_bytes):
            raise ReplayedError("a message comes a second time, or late")
        self._last, self._last_bytes = count, data
        return unpad(padded)

    def has_sealed(self, data: bytes) -> bool:
        """Whether a message was sealed under this key, and for this place, at any time."""
        try:
            self._decrypt(data)
        except ForgedError:
            return False
        return True

    def _decrypt(self, data: bytes) -> bytes:
        if len(data) < _HEAD.size + _TAG_BYTES:
            raise ForgedError("a message is too short to be sealed")
        try:
            return self._cipher.decrypt(_PREFIX + data[:8], data[_HEAD.size :], self._context + data[8 : _HEAD.size])
        except InvalidTag:
            raise ForgedError("a message does not open") from None


def truth_sealer(secret: bytes, salt: bytes, pit: str, match: str) -> Sealer:
    """Return what seals a match's truth for holders of the spectator key; `salt` is of one process, and not secret."""
    return Sealer(*_truth_key(secret, salt, pit, match))


def truth_opener(secret: bytes, salt: bytes, pit: str, match: str) -> Opener:
    """Return what opens what `truth_sealer` closed."""
    return Opener(*_truth_key(secret, salt, pit, match))


def _truth_key(secret: bytes, salt: bytes, pit: str, match: str) -> tuple[bytes, bytes]:
    key = derive_key(secret, "truth", salt, pit.encode(), match.encode())
    return key, f"arena {PROTOCOL_VERSION}/{pit}/{match}/truth/".encode()
