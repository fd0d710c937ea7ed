"""From a league's secret to the keys of one match. What a seat is given tells nothing of another.

map key    = HMAC-SHA256(secret, fixture, pair)
match key  = HMAC-SHA256(secret, match identity)
all others = HKDF-Expand(match key, a label each)          RFC 5869
"""

import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

KEY_BYTES = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchKeys:
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


class PhiloxKeys(NamedTuple):
    """What the kernels draw their words with, for `n` matches; uint32."""

    unit: NDArray[np.uint32]
    """Shape (n, 2 purposes, 2 teams, 2): of moves, and of fights."""
    seat: NDArray[np.uint32]
    """Shape (n, 2 teams, 2): of each team's own seeds."""
    board: NDArray[np.uint32]
    """Shape (n, 2)."""


def philox_keys(keys: Sequence[MatchKeys]) -> PhiloxKeys:
    """Return the Philox keys of some matches."""
    labels = ("moves", 16), ("fights", 16), ("blue seed", 8), ("red seed", 8)
    parts = [expand(key.match_key, label)[:size] for key in keys for label, size in labels]
    parts += [expand(key.map_key, "board")[:8] for key in keys]
    words, n = np.frombuffer(b"".join(parts), "<u4"), len(keys)  # of all at once: numpy takes longer than the hash
    of_match = words[: 12 * n].reshape(n, 12)
    return PhiloxKeys(
        unit=of_match[:, :8].reshape(n, 2, 2, 2), seat=of_match[:, 8:].reshape(n, 2, 2), board=words[12 * n :].reshape(n, 2)
    )


def _hmac(secret: bytes, *parts: str) -> bytes:
    """Return the HMAC of parts, each behind its length, so that no two lists of parts look alike."""
    message = b"".join(len(part.encode()).to_bytes(4, "big") + part.encode() for part in parts)
    return hmac.digest(secret, message, "sha256")
