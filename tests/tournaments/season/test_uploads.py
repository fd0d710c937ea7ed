"""Uploads: pieces become the submission that was announced, and nobody takes more memory, or time, than there is."""

from hashlib import sha256

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import InputError
from arena.protocol.messages import SeasonRequest
from arena.submission import PIECE_BYTES
from tournaments.season.uploads import IDLE_S, MOST_S, SHARE, Uploads

MOST = 1 << 20
DATA = bytes(range(256)) * 500
ANN = b"a" * 32


def piece(data: bytes, begin: int, end: int | None = None, *, owner: bytes = ANN, **changes: object) -> SeasonRequest:
    values = {
        "digest": sha256(data).digest(), "n_bytes": len(data), "offset": begin, "piece": data[begin:end], "entry": owner,
        **changes,
    }  # fmt: skip
    return SeasonRequest(command="upload", name="ann", **values)  # type: ignore[arg-type]


@given(st.lists(st.integers(1, PIECE_BYTES), min_size=3, max_size=8), st.data())
def test_pieces_that_come_late_twice_or_after_a_gap_become_what_was_announced(sizes: list[int], data: st.DataObject) -> None:
    uploads, whole, at = Uploads(MOST), DATA[: sum(sizes)], 0
    came: int | bytes | None = 0
    for number in range(100):
        size = sizes[number] if number < len(sizes) else PIECE_BYTES
        junk = data.draw(st.integers(0, len(whole) - 1)) if number < len(sizes) else at
        if junk not in (0, at):  # one that is out of turn changes nothing
            assert uploads.receive(piece(whole, junk, junk + 1), 0.0) == at
        came = uploads.receive(piece(whole, at, at + size), 0.0)
        if isinstance(came, bytes):
            break
        assert came is not None
        at = came

    assert came == whole
    assert uploads.n_held_bytes == 0


def test_a_submission_of_one_piece_is_taken_though_others_hold_all_memory() -> None:
    uploads = Uploads(MOST)
    held = [uploads.receive(piece(bytes(MOST), 0, 10, owner=bytes([n]) * 32), 0.0) for n in range(2 * SHARE)]

    assert held == [10] * SHARE + [None] * SHARE
    assert uploads.n_held_bytes == SHARE * MOST
    assert uploads.receive(piece(b"small", 0), 0.0) == b"small"


def test_an_upload_that_does_not_go_on_or_takes_too_long_makes_room() -> None:
    uploads = Uploads(MOST)
    for number in range(SHARE):
        uploads.receive(piece(bytes(MOST), 0, 10, owner=bytes([number]) * 32), 0.0)
    at, now_s = 10, 0.0
    while now_s < MOST_S - IDLE_S:  # one goes on, slowly
        now_s += IDLE_S / 2
        assert uploads.receive(piece(bytes(MOST), at, at + 1, owner=bytes(32)), now_s) == at + 1
        at += 1

    assert uploads.n_held_bytes == MOST
    assert uploads.receive(piece(bytes(MOST), 0, 10), now_s) == 10
    uploads.forget_idle(now_s + IDLE_S)
    assert uploads.n_held_bytes == 0


def test_another_submission_of_one_owner_takes_the_place_of_the_first() -> None:
    uploads = Uploads(MOST)
    uploads.receive(piece(bytes(MOST), 0, 10), 0.0)

    assert uploads.receive(piece(DATA, 0, 20), 0.0) == 20
    assert uploads.n_held_bytes == len(DATA)


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        (piece(bytes(MOST + 1), 0, 10), "has 1,048,577 bytes, and this season takes 1,048,576"),
        (piece(DATA, 0, 0), "no part of the submission"),
        (piece(DATA, 0, PIECE_BYTES + 1), "no part of the submission"),
        (piece(DATA, -1, 10), "no part of the submission"),
        (piece(DATA, 0, 10, n_bytes=5), "no part of the submission"),
        (piece(DATA, 0, 10, n_bytes=-1), "no part of the submission"),
        (piece(DATA, 0, 10, digest=b""), "no part of the submission"),
        (piece(b"small", 0, digest=bytes(32)), "not what was announced"),
    ],
)
def test_a_piece_that_cannot_be_is_refused_and_holds_nothing(request_: SeasonRequest, says: str) -> None:
    uploads = Uploads(MOST)

    with pytest.raises(InputError, match=says):
        uploads.receive(request_, 0.0)

    assert uploads.n_held_bytes == 0
