"""Journals that outlive a power cut, at the price of the disk; many that wait together pay it once."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from threading import Thread

from arena.errors import ArenaError
from arena.pit.gate import Gate
from arena.pit.journal_files import JournalFile, failure_of

_N_THREADS = 16
"""Each waits for the disk; a journalling file system writes what they wait for at one go."""


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_N_THREADS, thread_name_prefix="sync")


def sync_journals(paths: Iterable[Path]) -> None:
    """Return when the disk has all that was written to some files; `ArenaError` if it cannot have it."""
    _sync_all(_sync, paths)


def sync_records(written: Iterable[JournalFile]) -> None:
    """Return when the disk has all that was appended to some journals, and the names of those that are new; else as above."""
    journals = set(written)
    sync_journals({journal.path for journal in journals})
    named = [journal for journal in journals if journal.has_new_name]
    _sync_all(_sync_names, {journal.path.parent for journal in named})
    for journal in named:
        journal.has_new_name = False


def _sync_all(sync: Callable[[Path], None], paths: Iterable[Path]) -> None:
    try:
        list(_pool().map(sync, paths))
    except OSError as error:
        raise failure_of(error) from error


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_WRONLY)
    try:
        os.fdatasync(descriptor)
    finally:
        os.close(descriptor)


def _sync_names(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)  # to fdatasync, some file systems count names for no data
    finally:
        os.close(descriptor)


class JournalSync:
    """Syncs what a loop writes, on a thread of its own.

    Parameters
    ----------
    gate
        Told what stands.
    wake
        Wakes the loop, for it to release what was held.
    """

    def __init__(self, gate: Gate, wake: Callable[[], None]) -> None:
        self._gate, self._wake = gate, wake
        self._written: SimpleQueue[JournalFile | None] = SimpleQueue()
        self.error: ArenaError | None = None
        """What has gone wrong: then nothing more will stand."""
        self._thread = Thread(target=self._run, name="journal sync", daemon=True)
        self._thread.start()

    def note(self, journal: JournalFile) -> None:
        """Note that a journal was appended to."""
        self._gate.n_written += 1
        self._written.put(journal)

    def close(self) -> None:
        """End the thread, after what was noted."""
        self._written.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (first := self._written.get()) is not None:
            journals = [first]
            for _ in range(self._written.qsize()):
                journal = self._written.get()
                if journal is None:
                    self._written.put(None)  # for the next turn of this loop
                else:
                    journals.append(journal)
            try:
                sync_records(journals)
            except ArenaError as error:
                self.error = error
                self._wake()
                return
            self._gate.n_standing += len(journals)
            self._wake()


class SyncedJournal:
    """A journal of a loop whose records are synced."""

    def __init__(self, journal: JournalFile, sync: JournalSync) -> None:
        self._journal, self._sync = journal, sync
        self.close = journal.close

    def append(self, data: bytes) -> None:
        """Append, and have that synced."""
        self._journal.append(data)
        self._sync.note(self._journal)
