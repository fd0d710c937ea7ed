"""The journals of a pit as files: whole or refused, given in pieces that fit a message, and found again."""

import errno
import logging
import os
import stat
from pathlib import Path
from typing import Any

import pytest
from offline_pit import OfflinePit, begin, play

from arena.errors import ArenaError
from arena.pit.journal_files import PIECE_BYTES, JournalFile, OpenJournals, SpareJournals, find_unfinished, read_piece
from arena.protocol.codec import MOST_BYTES, decode
from arena.protocol.messages import JournalPiece, Refusal

DATA = bytes(range(256)) * 500  # 128,000 bytes: three pieces


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "pit+0.journal"
    path.write_bytes(DATA)
    return path


def read(path: Path, offset: int) -> JournalPiece:
    answer = read_piece(path, offset)
    assert len(answer) <= MOST_BYTES
    piece = decode(answer)
    assert isinstance(piece, JournalPiece)
    return piece


def test_a_journal_of_many_pieces_comes_together(path: Path) -> None:
    data, n_pieces = b"", 0
    while len(data) < len(DATA):
        piece = read(path, len(data))
        assert (piece.n_bytes, piece.offset) == (len(DATA), len(data))
        assert 0 < len(piece.data) <= PIECE_BYTES
        data += piece.data
        n_pieces += 1

    assert (data, n_pieces) == (DATA, 3)


@pytest.mark.parametrize("offset", [len(DATA), len(DATA) + 1, 2**40, 2**63, 2**64 - 1])
def test_beyond_the_end_there_is_nothing(path: Path, offset: int) -> None:
    assert read(path, offset) == JournalPiece(n_bytes=len(DATA), offset=offset, data=b"")


def test_a_file_that_is_gone_is_reported(path: Path) -> None:
    path.unlink()

    assert decode(read_piece(path, 0)) == Refusal(reason="the journal cannot be read: No such file or directory")


def test_a_new_journal_is_the_owner_s_alone_and_a_resumed_one_is_cut_to_its_whole_part(path: Path) -> None:
    new = path.with_name("new.journal")
    for file, kept in ((new, 0), (path, 100)):
        journal = JournalFile(file, kept)
        journal.append(b"more")
        journal.close()

    assert stat.S_IMODE(new.stat().st_mode) == 0o600
    assert (new.read_bytes(), path.read_bytes()) == (b"more", DATA[:100] + b"more")


def test_a_journal_that_cannot_be_written_raises_a_sentence(tmp_path: Path) -> None:
    journal = JournalFile(tmp_path / "journal", 0)
    journal.close()

    with pytest.raises(ArenaError, match=r"^cannot write a journal: Bad file descriptor$"):
        journal.append(b"data")
    with pytest.raises(ArenaError, match=r"^cannot write a journal: No such file or directory$"):
        JournalFile(tmp_path / "gone" / "journal", 0)


def test_unfinished_matches_are_found_without_a_record_that_was_cut_short(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pit = OfflinePit()
    play(*begin(pit))
    ann, bob = begin(pit, "eve", "dan")
    play(ann, bob, n_ticks=2)
    for name, data in pit.journals.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "pit+2.journal").write_bytes(pit.journals["pit+2.journal"] + b"T\0\0")
    (tmp_path / "junk.journal").write_bytes(b"junk")

    with caplog.at_level(logging.WARNING):
        [found] = find_unfinished(tmp_path)

    assert (found.name, len(found.journal.ticks)) == ("pit+2.journal", 2)
    assert found.n_bytes == len(pit.journals["pit+2.journal"])
    assert set(found.entries.values()) == {ann.identity.public, bob.identity.public}
    assert "junk.journal cannot be resumed" in caplog.text


def test_no_journal_is_written_over_by_that_of_a_match_that_is_played_again(tmp_path: Path) -> None:
    for data in (b"first", b"second", b"third"):
        spare = SpareJournals(tmp_path)
        spare.refill()
        journal = spare.take("pit+0.journal")
        journal.append(data)
        journal.close()
        spare.close()

    kept = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert kept == {"pit+0.journal.1": b"first", "pit+0.journal.2": b"second", "pit+0.journal": b"third"}


def test_many_journals_have_no_more_files_open_than_few(tmp_path: Path) -> None:
    among, before = OpenJournals(most=3), len(list(Path("/dev/fd").iterdir()))
    journals = [JournalFile(tmp_path / f"{number}", 0, among=among) for number in range(9)]
    for _ in range(3):
        for number, journal in enumerate(journals):
            journal.append(b"%d" % number)

    assert len(list(Path("/dev/fd").iterdir())) <= before + 3
    for number, journal in enumerate(journals):
        journal.close()
        assert (tmp_path / f"{number}").read_bytes() == b"%d" % number * 3
    assert len(list(Path("/dev/fd").iterdir())) == before


def test_journals_are_written_on_while_no_more_files_can_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    among = OpenJournals(most=3)
    journals = [JournalFile(tmp_path / name, 0, among=among) for name in "ab"]
    open_one, most = os.open, 2

    def scarce(*arguments: Any, **options: Any) -> int:
        if len(among.descriptors) >= most:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return open_one(*arguments, **options)

    monkeypatch.setattr("arena.pit.journal_files.os.open", scarce)
    with pytest.raises(ArenaError):  # a new match costs no other its file
        JournalFile(tmp_path / "c", 0, among=among)
    among.close(0)
    most = 1
    for _ in range(2):
        for journal in journals:
            journal.append(b"x")

    assert [(tmp_path / name).read_bytes() for name in "ab"] == [b"xx"] * 2
