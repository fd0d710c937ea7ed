"""The archive: a journal comes in pieces that fit a message, once it may be seen, and no question brings it down."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arena.game.ruleset import Ruleset
from arena.pit import archive as module
from arena.pit.archive import PIECE_BYTES, Archive
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.messages import Hello, JournalPiece, JournalRequest, Message, Refusal, Wait
from arena.records.journal import Header, journal_name

DATA = bytes(range(256)) * 500  # 128,000 bytes: three pieces


@pytest.fixture
def header_of(small_rules: Ruleset, planned: Callable[..., Any]) -> Callable[[str], Header]:
    def make(identity: str) -> Header:
        return Header(identity=identity, blue="one", red="other", ruleset=small_rules, keys=planned(identity).keys)

    return make


@pytest.fixture
def archive(tmp_path: Path, header_of: Callable[[str], Header]) -> Archive:
    """Return an archive with one match, `m`, that anybody may see."""
    (tmp_path / journal_name("pit/0")).write_bytes(DATA)
    one = Archive(tmp_path)
    one.add("m", header_of("pit/0"), lambda: True)
    return one


def ask(archive: Archive, offset: int, match: str = "m") -> Message:
    answer = archive.answer(match, encode(JournalRequest(offset=offset)))
    assert len(answer) <= MOST_BYTES
    return decode(answer)


def test_a_journal_of_many_pieces_comes_together(archive: Archive) -> None:
    read, n_pieces = b"", 0
    while len(read) < len(DATA):
        piece = ask(archive, len(read))
        assert isinstance(piece, JournalPiece)
        assert (piece.n_bytes, piece.offset) == (len(DATA), len(read))
        assert 0 < len(piece.data) <= PIECE_BYTES
        read += piece.data
        n_pieces += 1

    assert read == DATA
    assert n_pieces == 3


def test_a_piece_may_be_asked_for_from_anywhere_and_again(archive: Archive) -> None:
    for offset in (0, 1, PIECE_BYTES - 1, 99_999, len(DATA) - 1, 0):
        assert ask(archive, offset) == JournalPiece(n_bytes=len(DATA), offset=offset, data=DATA[offset : offset + PIECE_BYTES])


@pytest.mark.parametrize("offset", [len(DATA), len(DATA) + 1, 2**40, 2**63, 2**64 - 1])
def test_beyond_the_end_there_is_nothing(archive: Archive, offset: int) -> None:
    assert ask(archive, offset) == JournalPiece(n_bytes=len(DATA), offset=offset, data=b"")


@pytest.mark.parametrize("offset", [-1, -(2**63)])
def test_before_the_beginning_there_is_a_refusal(archive: Archive, offset: int) -> None:
    assert ask(archive, offset) == Refusal(reason="this is no request for a journal")


@pytest.mark.parametrize("match", ["other", "", "m/..", "../m", "*", "pit+0.journal"])
def test_a_match_that_is_not_there_is_refused(archive: Archive, match: str) -> None:
    assert ask(archive, 0, match) == Refusal(reason=f"there is no journal of a match {match}, or the match is not over")


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (b"", "the request cannot be read: the bytes are not msgpack"),
        (b"\xc1" * 10, "the request cannot be read: the bytes are not msgpack"),
        (bytes(MOST_BYTES + 1), "the request cannot be read: "),
        (encode(JournalRequest(offset="0")), "the request cannot be read: JournalRequest.offset is of another type"),  # type: ignore[arg-type]
        (encode(Hello()), "this is no request for a journal"),
        (encode(JournalPiece(n_bytes=1, offset=0, data=b"x")), "this is no request for a journal"),
    ],
)
def test_what_is_no_request_is_refused(archive: Archive, payload: bytes, why: str) -> None:
    answer = decode(archive.answer("m", payload))

    assert isinstance(answer, Refusal)
    assert answer.reason.startswith(why)
    assert ask(archive, 0) != answer


def test_a_journal_that_may_not_be_seen_yet_is_to_be_waited_for(tmp_path: Path, header_of: Callable[[str], Header]) -> None:
    (tmp_path / journal_name("pit/0")).write_bytes(b"secret")
    archive, is_open = Archive(tmp_path), [False]
    archive.add("m", header_of("pit/0"), lambda: is_open[0])

    assert [ask(archive, offset) for offset in (0, 3, 100)] == [Wait(reason="until the last match of these two is over")] * 3
    is_open[0] = True
    assert ask(archive, 0) == JournalPiece(n_bytes=6, offset=0, data=b"secret")
    is_open[0] = False
    assert isinstance(ask(archive, 0), Wait)


def test_each_match_has_its_own_journal(tmp_path: Path, header_of: Callable[[str], Header]) -> None:
    archive = Archive(tmp_path)
    for number in range(3):
        (tmp_path / journal_name(f"pit/{number}")).write_bytes(bytes([number]))
        archive.add(f"m{number}", header_of(f"pit/{number}"), lambda: True)

    assert [ask(archive, 0, f"m{number}").data for number in range(3)] == [b"\0", b"\1", b"\2"]  # type: ignore[union-attr]


def test_a_file_that_is_gone_is_said_to_be_so(archive: Archive, tmp_path: Path) -> None:
    (tmp_path / journal_name("pit/0")).unlink()

    assert ask(archive, 0) == Refusal(reason="the journal cannot be read: No such file or directory")


def test_the_oldest_of_too_many_matches_are_forgotten(
    tmp_path: Path, header_of: Callable[[str], Header], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_KEPT", 3)
    archive = Archive(tmp_path)
    for number in range(5):
        (tmp_path / journal_name(f"pit/{number}")).write_bytes(b"x")
        archive.add(f"m{number}", header_of(f"pit/{number}"), lambda: True)

    kept = [isinstance(ask(archive, 0, f"m{number}"), JournalPiece) for number in range(5)]

    assert kept == [False, False, True, True, True]
