"""What a pit under --fsync does before the disk has its records: other work, and nothing that follows from them."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arena.errors import ArenaError
from arena.pit import journal_sync
from arena.pit.gate import Gate
from arena.pit.journal_files import JournalFile
from arena.pit.journal_sync import JournalSync, SyncedJournal, sync_journals
from arena.pit.workers.journal_copies import JournalCopies
from arena.pit.workers.messages import Piece, Written

PATIENCE_S = 30.0


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A disk that waits until it is let, and says what it was asked for."""
    asked: list[Path] = []
    ready = threading.Event()
    really = journal_sync._sync

    def slow(path: Path) -> None:
        asked.append(path)
        assert ready.wait(PATIENCE_S)
        really(path)

    monkeypatch.setattr(journal_sync, "_sync", slow)
    return asked, ready


def test_what_follows_from_a_record_leaves_in_its_order_once_the_disk_has_it(tmp_path: Path, disk: Any) -> None:
    asked, ready = disk
    gate, woken, done = Gate(), threading.Semaphore(0), []
    sync = JournalSync(gate, woken.release)
    journals = [SyncedJournal(JournalFile(tmp_path / name, 0), sync) for name in "ab"]

    journals[0].append(b"one")
    gate.hold(lambda: done.append("after one"))
    for journal in (journals[1], journals[0], journals[1]):
        journal.append(b"more")
    gate.hold(lambda: done.append("after all"))
    gate.release()
    assert (done, gate.is_open) == ([], False)

    ready.set()
    while len(done) < 2:
        assert woken.acquire(timeout=PATIENCE_S)
        gate.release()
    sync.close()
    assert done == ["after one", "after all"]
    assert gate.is_open
    assert gate.n_standing == gate.n_written == 4
    assert len(asked) <= 3, "records that wait together are synced together"
    assert (tmp_path / "a").read_bytes() == b"onemore"


def test_what_cannot_be_synced_is_told_and_never_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate, woken = Gate(), threading.Semaphore(0)
    sync = JournalSync(gate, woken.release)
    journal = SyncedJournal(JournalFile(tmp_path / "a", 0), sync)
    journal.append(b"one")
    (tmp_path / "a").unlink()
    journal.append(b"two")
    sync._thread.join(PATIENCE_S)
    assert "cannot write a journal" in str(sync.error)
    assert not gate.is_open
    with pytest.raises(ArenaError, match="cannot write a journal"):
        sync_journals([tmp_path / "a"])


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What the disk has been made to have: the inodes of files and folders, in that order."""
    inodes: list[int] = []
    for name, sync in (("fdatasync", os.fdatasync), ("fsync", os.fsync)):

        def note(descriptor: int, sync: Callable[[int], None] = sync) -> None:
            sync(descriptor)
            inodes.append(os.fstat(descriptor).st_ino)

        monkeypatch.setattr(os, name, note)
    return inodes


def test_the_name_of_a_new_journal_outlives_a_power_cut_as_its_first_record_does(tmp_path: Path, synced: list[int]) -> None:
    gate, woken = Gate(), threading.Semaphore(0)
    sync = JournalSync(gate, woken.release)
    spare = JournalFile(tmp_path / ".spare-0", 0)
    spare.rename_when_written(tmp_path / "a.journal")
    journal, folder = SyncedJournal(spare, sync), tmp_path.stat().st_ino

    journal.append(b"one")
    assert woken.acquire(timeout=PATIENCE_S)
    file = (tmp_path / "a.journal").stat().st_ino
    assert synced == [file, folder]
    journal.append(b"more")
    sync.close()

    assert synced == [file, folder, file]


def test_so_does_that_of_a_journal_of_another_machine(tmp_path: Path, synced: list[int]) -> None:
    copies = JournalCopies(tmp_path, fsync=True)

    for number in range(2):
        copies.write(Written((Piece("match", "a.journal", number, b"x"),)))

    file = (tmp_path / "a.journal").stat().st_ino
    assert synced == [file, tmp_path.stat().st_ino, file]
