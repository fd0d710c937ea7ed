"""SHA-256 of many messages at once, side by side in the processor's vector registers.

A batch of matches has a message for each of them at every tick, and calling `hashlib` for each takes longer than the hashes.

Source: FIPS 180-4.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.jit import jit

DIGEST_BYTES = 32
BLOCK_BYTES = 64
_LENGTH_BYTES = 8
_LANES = 32
"""Messages side by side: all that they need at once stays in the nearest cache."""
_SUM, _WORD, _N_ROWS = 8, 16, 32
"""Rows of the scratch memory, a lane in each column: the 8 words of the hash, from here on their sums in this block, and from
here on 16 words of the block."""
_PRIMES = [number for number in range(2, 312) if all(number % divisor for divisor in range(2, number))]
_FIRST = np.array([int(prime ** (1 / 2) % 1 * 2**32) for prime in _PRIMES[:8]], np.uint32)
_ROUND = np.array([int(prime ** (1 / 3) % 1 * 2**32) for prime in _PRIMES], np.uint32)


def pad_messages(n_messages: int, n_bytes: int) -> NDArray[np.uint8]:
    """Return zeros for messages of one length, behind each what SHA-256 ends it with; shape (n_messages, whole blocks)."""
    n_blocks = -(-(n_bytes + 1 + _LENGTH_BYTES) // BLOCK_BYTES)
    padded = np.zeros((n_messages, n_blocks * BLOCK_BYTES), np.uint8)
    padded[:, n_bytes] = 0x80
    padded[:, -_LENGTH_BYTES:] = np.frombuffer((8 * n_bytes).to_bytes(_LENGTH_BYTES, "big"), np.uint8)
    return padded


def hash_messages(padded: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the digests of messages of `pad_messages`, which may have any leading axes; shape (..., 32)."""
    words = padded.view(">u4").astype(np.uint32)
    digests = np.empty((*words.shape[:-1], DIGEST_BYTES // 4), np.uint32)
    _hash(words.reshape(-1, words.shape[-1]), digests.reshape(-1, digests.shape[-1]), np.empty(_N_ROWS * _LANES, np.uint32))
    return digests.astype(">u4").view(np.uint8)


@jit()
def _hash(words: NDArray[np.uint32], digests: NDArray[np.uint32], scratch: NDArray[np.uint32]) -> None:
    for first in range(0, len(words), _LANES):
        n_lanes = min(_LANES, len(words) - first)
        for row in range(8):
            for lane in range(n_lanes):
                scratch[row * _LANES + lane] = _FIRST[row]
        for at in range(0, words.shape[1], 16):
            for lane in range(n_lanes):
                for word in range(16):
                    scratch[(_WORD + word) * _LANES + lane] = words[first + lane, at + word]
            _take_block(scratch, n_lanes)
        for lane in range(n_lanes):
            for row in range(8):
                digests[first + lane, row] = scratch[row * _LANES + lane]


@jit()
def _take_block(scratch: NDArray[np.uint32], n_lanes: int) -> None:
    """Take one block of each lane into its hash."""
    for row in range(8):
        for lane in range(n_lanes):
            scratch[(_SUM + row) * _LANES + lane] = scratch[row * _LANES + lane]
    for first in range(0, 64, 8):
        if first >= 16:
            for number in range(first, first + 8):
                _extend(scratch, number, n_lanes)
        for lane in range(n_lanes):
            _play_rounds(scratch, first, lane)
    for row in range(8):
        for lane in range(n_lanes):
            at = row * _LANES + lane
            scratch[at] = _add(scratch[at], scratch[_SUM * _LANES + at])


@jit(inline=True)
def _extend(scratch: NDArray[np.uint32], number: int, n_lanes: int) -> None:
    """Make the next word of the schedule, in the place of the one 16 before."""
    oldest, early = (_WORD + number % 16) * _LANES, (_WORD + (number + 1) % 16) * _LANES
    later, last = (_WORD + (number + 9) % 16) * _LANES, (_WORD + (number + 14) % 16) * _LANES
    for lane in range(n_lanes):
        one, two = scratch[early + lane], scratch[last + lane]
        one = _turn(one, 7) ^ _turn(one, 18) ^ np.uint32(one >> np.uint32(3))
        two = _turn(two, 17) ^ _turn(two, 19) ^ np.uint32(two >> np.uint32(10))
        scratch[oldest + lane] = _add(_add(scratch[oldest + lane], one), _add(scratch[later + lane], two))


@jit(inline=True)
def _play_rounds(scratch: NDArray[np.uint32], first: int, lane: int) -> None:
    """Play eight rounds, after which each word is in its place again."""
    at, word = _SUM * _LANES + lane, (_WORD + first % 16) * _LANES + lane
    a, b, c, d = scratch[at], scratch[at + _LANES], scratch[at + 2 * _LANES], scratch[at + 3 * _LANES]
    at += 4 * _LANES
    e, f, g, h = scratch[at], scratch[at + _LANES], scratch[at + 2 * _LANES], scratch[at + 3 * _LANES]
    d, h = _round(a, b, c, d, e, f, g, h, _ROUND[first], scratch[word])
    c, g = _round(h, a, b, c, d, e, f, g, _ROUND[first + 1], scratch[word + _LANES])
    b, f = _round(g, h, a, b, c, d, e, f, _ROUND[first + 2], scratch[word + 2 * _LANES])
    a, e = _round(f, g, h, a, b, c, d, e, _ROUND[first + 3], scratch[word + 3 * _LANES])
    h, d = _round(e, f, g, h, a, b, c, d, _ROUND[first + 4], scratch[word + 4 * _LANES])
    g, c = _round(d, e, f, g, h, a, b, c, _ROUND[first + 5], scratch[word + 5 * _LANES])
    f, b = _round(c, d, e, f, g, h, a, b, _ROUND[first + 6], scratch[word + 6 * _LANES])
    e, a = _round(b, c, d, e, f, g, h, a, _ROUND[first + 7], scratch[word + 7 * _LANES])
    at -= 4 * _LANES
    scratch[at], scratch[at + _LANES], scratch[at + 2 * _LANES], scratch[at + 3 * _LANES] = a, b, c, d
    at += 4 * _LANES
    scratch[at], scratch[at + _LANES], scratch[at + 2 * _LANES], scratch[at + 3 * _LANES] = e, f, g, h


@jit(inline=True)
def _round(a: Any, b: Any, c: Any, d: Any, e: Any, f: Any, g: Any, h: Any, constant: Any, word: Any) -> tuple[Any, Any]:
    """Return what becomes of `d` and `h`."""
    chosen, most = g ^ (e & (f ^ g)), (a & b) | (c & (a | b))
    sum_ = _add(_add(_add(h, constant), word), _add(_turn(e, 6) ^ _turn(e, 11) ^ _turn(e, 25), chosen))
    return _add(d, sum_), _add(sum_, _add(_turn(a, 2) ^ _turn(a, 13) ^ _turn(a, 22), most))


@jit(inline=True)
def _turn(word: Any, n_bits: int) -> Any:
    """Return a word turned right."""
    return np.uint32(word >> np.uint32(n_bits)) | np.uint32(word << np.uint32(32 - n_bits))


@jit(inline=True)
def _add(one: Any, other: Any) -> Any:
    """Return a sum in 32 bits: numba makes 64 of it, and vectors half as wide."""
    return np.uint32(one + other)
