"""Philox against its published test vectors, and against the oracle's own."""

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.game.philox import below, philox
from arena.jit import jit

WORDS = st.integers(0, 2**32 - 1)

# Random123, kat_vectors, philox4x32 10: counter, key, result.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


@jit()
def _draw(key, c0, c1, c2, c3, out):  # type: ignore[no-untyped-def]
    words = philox(key, c0, c1, c2, c3)
    for i in range(4):
        out[i] = words[i]


@jit()
def _below(words, n, out):  # type: ignore[no-untyped-def]
    for i in range(len(words)):
        out[i] = below(words[i], n)


def draw(key: tuple[int, ...], counter: tuple[int, ...]) -> tuple[int, ...]:
    """Return four words of the compiled generator."""
    out = np.zeros(4, np.uint64)
    _draw(np.array(key, np.uint32), *(np.uint32(c) for c in counter), out)
    return tuple(int(word) for word in out)


@pytest.mark.parametrize(("counter", "key", "result"), KNOWN)
def test_philox_gives_its_published_vectors(counter: str, key: str, result: str) -> None:
    numbers, keys, expected = (tuple(int(word, 16) for word in text.split()) for text in (counter, key, result))

    assert draw(keys, numbers) == expected
    assert oracle.philox(keys, numbers) == expected


@given(st.tuples(WORDS, WORDS), st.tuples(WORDS, WORDS, WORDS, WORDS))
def test_the_oracle_draws_the_same_words(key: tuple[int, int], counter: tuple[int, int, int, int]) -> None:
    assert draw(key, counter) == oracle.philox(key, counter)


def test_a_choice_below_n_takes_every_value_equally_often() -> None:
    for n in (1, 2, 3, 7, 400, 4096):
        edges = np.array([-(-i * 2**32 // n) for i in range(n)], np.uint64)
        first, last = np.zeros(n, np.int64), np.zeros(n, np.int64)
        _below(edges, n, first)
        _below(np.append(edges[1:], 2**32).astype(np.uint64) - np.uint64(1), n, last)

        assert first.tolist() == last.tolist() == list(range(n))
