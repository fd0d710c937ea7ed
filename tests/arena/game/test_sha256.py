"""SHA-256 of many messages at once, against the one of the standard library."""

from hashlib import sha256

import numpy as np
import pytest

from arena.game.sha256 import hash_messages, pad_messages


@pytest.mark.parametrize("n_messages", [1, 7, 32, 33, 100])
@pytest.mark.parametrize("n_bytes", [0, 1, 55, 56, 63, 64, 99, 119, 120, 1000])
def test_each_message_has_the_hash_that_the_library_gives_it(n_messages: int, n_bytes: int) -> None:
    messages = np.random.default_rng(n_bytes).integers(256, size=(n_messages, n_bytes), dtype=np.uint8)
    padded = pad_messages(n_messages, n_bytes)
    padded[:, :n_bytes] = messages

    digests = hash_messages(padded)

    assert [digest.tobytes() for digest in digests] == [sha256(message.tobytes()).digest() for message in messages]


def test_no_messages_have_no_hashes() -> None:
    assert hash_messages(pad_messages(0, 99)).shape == (0, 32)
