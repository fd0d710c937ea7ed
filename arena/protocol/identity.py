"""Who says something: an Ed25519 key, and what it signs. A public key is 43 letters, digits, - and _, and is its own fingerprint.

Every signature stands under a label, so that no signed thing can be passed off as another.
"""

import base64
import binascii

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from arena.errors import ForgedError, InputError

PUBLIC_BYTES = 32
SIGNATURE_BYTES = 64
_PRIME = 2**255 - 19
_EIGHTH = 0x05FC536D880238B13933C6D305ACDFD5F098EFF289F4C345B027B2C28F95E826
"""y of a point of order 8."""
_SMALL_ORDER = frozenset({0, 1, _PRIME - 1, _PRIME, _PRIME + 1, _EIGHTH, _PRIME - _EIGHTH})
"""y of the public keys for which anybody can make signatures; the library takes them."""


class Identity:
    """A private key: of an entry, or of a pit."""

    def __init__(self, private: Ed25519PrivateKey) -> None:
        self.private = private
        self.public = private.public_key().public_bytes_raw()
        """32 bytes."""

    @classmethod
    def make(cls) -> "Identity":
        """Return a new one."""
        return cls(Ed25519PrivateKey.generate())

    @property
    def fingerprint(self) -> str:
        """The public key as text."""
        return to_text(self.public)

    def sign(self, label: str, data: bytes) -> bytes:
        """Return the signature of `data` under a label; 64 bytes."""
        return self.private.sign(_labelled(label, data))


def verify(public: bytes, label: str, data: bytes, signature: bytes) -> None:
    """Check what `Identity.sign` gave.

    Raises
    ------
    ForgedError
        Another key signed, or other data, or under another label; or the key is none.
    """
    if int.from_bytes(public, "little") % 2**255 in _SMALL_ORDER:
        raise ForgedError(f"the key that signed a {label} is everybody's")
    try:
        Ed25519PublicKey.from_public_bytes(public).verify(signature, _labelled(label, data))
    except (InvalidSignature, ValueError) as error:
        raise ForgedError(f"the signature of a {label} does not hold") from error


def to_text(public: bytes) -> str:
    """Return a public key as text."""
    return base64.urlsafe_b64encode(public).decode().rstrip("=")


def from_text(text: str) -> bytes:
    """Read what `to_text` wrote; `InputError` if it is no public key."""
    try:
        public = base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True)
    except (binascii.Error, ValueError):
        public = b""
    if len(public) != PUBLIC_BYTES or to_text(public) != text:
        raise InputError(f"{text!r} is no public key; it has 43 letters, digits, - and _")
    return public


def is_public_key(text: str) -> bool:
    """Whether a text is what `to_text` writes of some key."""
    try:
        from_text(text)
    except InputError:
        return False
    return True


def _labelled(label: str, data: bytes) -> bytes:
    return b"arena " + label.encode() + b"\0" + data
