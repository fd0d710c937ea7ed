"""From a league's secret to the keys of one match. What a seat is given tells nothing of another.

map key    = HMAC-SHA256(secret, fixture, pair)
match key  = HMAC-SHA256(secret, match identity)
all others = HKDF-Expand(match key, a label each)          RFC 5869
"""

import hmac
import secrets
from collections.abc import Sequence
from hashlib import sha256
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.sha256 import BLOCK_BYTES, DIGEST_BYTES, hash_messages, pad_messages

KEY_BYTES = 32


class MatchKeys(NamedTuple):
    """All the randomness of one match."""

    map_key: bytes
    match_key: bytes


def new_secret() -> bytes:
    """Return 32 bytes of the system's randomness."""
    return secrets.token_bytes(KEY_BYTES)


def secret_from_seed(seed: int) -> bytes:
    """Return the secret of a plain seed, for reproducible leagues of one's own; anyone can try small seeds."""
    return sha256(f"arena seed {seed}".encode()).digest()


def derive_map_key(secret: bytes, fixture: str, pair: int) -> bytes:
    """Return what both legs of a pair share: the map, and nothing else."""
    return _hmac(secret, "map", fixture, str(pair))


def derive_match_key(secret: bytes, identity: str) -> bytes:
    """Return the key of one match; `identity` is the match's own, never used twice."""
    return _hmac(secret, "match", identity)


def expand(match_key: bytes, label: str) -> bytes:
    """Return 32 bytes under a label: the first block of HKDF-Expand."""
    return hmac.digest(match_key, b"arena " + label.encode() + b"\x01", "sha256")


_LABELS = "moves", "fights", "blue seed", "red seed", "board"
"""The last of a map key, the others of a match key."""


def _pad_hmac(pad: int, message: bytes) -> NDArray[np.uint8]:
    """Return what HMAC hashes under a key of zeros."""
    padded = pad_messages(1, BLOCK_BYTES + len(message))
    padded[0, : BLOCK_BYTES + len(message)] = [pad] * BLOCK_BYTES + list(message)
    return padded


_INNER = np.concatenate([_pad_hmac(0x36, b"arena " + label.encode() + b"\x01") for label in _LABELS])
_OUTER = _pad_hmac(0x5C, bytes(DIGEST_BYTES))


class PhiloxKeys(NamedTuple):
    """What the kernels draw their words with, for `n` matches; uint32."""

    unit: NDArray[np.uint32]
    """Shape (n, 2 purposes, 2 teams, 2): of moves, and of fights."""
    seat: NDArray[np.uint32]
    """Shape (n, 2 teams, 2): of each team's own seeds."""
    board: NDArray[np.uint32]
    """Shape (n, 2)."""


def philox_keys(keys: Sequence[MatchKeys]) -> PhiloxKeys:
    """Return the Philox keys of some matches: `expand`, of all of them at once."""
    n = len(keys)
    match_keys, map_keys = b"".join([key.match_key for key in keys]), b"".join([key.map_key for key in keys])
    secrets = np.empty((n, len(_LABELS), KEY_BYTES), np.uint8)
    secrets[:, :-1] = np.frombuffer(match_keys, np.uint8).reshape(n, 1, KEY_BYTES)
    secrets[:, -1] = np.frombuffer(map_keys, np.uint8).reshape(n, KEY_BYTES)
    inner, outer = np.empty((n, *_INNER.shape), np.uint8), np.empty((n, *_INNER.shape), np.uint8)
    inner[:], outer[:] = _INNER, _OUTER
    inner[..., :KEY_BYTES] ^= secrets
    outer[..., :KEY_BYTES] ^= secrets
    outer[..., BLOCK_BYTES : BLOCK_BYTES + DIGEST_BYTES] = hash_messages(inner)
    words = hash_messages(outer).view("<u4")
    return PhiloxKeys(unit=words[:, :2, :4].reshape(n, 2, 2, 2), seat=words[:, 2:4, :2], board=words[:, 4, :2])


def _hmac(secret: bytes, *parts: str) -> bytes:
    """Return the HMAC of parts, each behind its length, so that no two lists of parts look alike."""
    message = b"".join(len(part.encode()).to_bytes(4, "big") + part.encode() for part in parts)
    return hmac.digest(secret, message, "sha256")
