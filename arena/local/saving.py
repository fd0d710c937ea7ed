"""The journals of a local match as files, written beside the games."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING

from arena.errors import InputError
from arena.folders import make_folder
from arena.records.journal import save_journal

if TYPE_CHECKING:
    from arena.local.venue import MatchRecord

_RECORDS_PER_WRITE, _MOST_UNWRITTEN = 16, 1024
_WRITE_EVERY_S = 0.1


def make_journals_folder(folder: Path) -> None:
    """Make the folder of journals, unless it is there; `InputError` if it cannot be."""
    make_folder(folder, f"cannot keep journals in {folder}")


def save(records: Iterable["MatchRecord"], folder: Path) -> Iterator["MatchRecord"]:
    """Yield records once their journals are written, by a thread beside the games: the disk may take its time.

    A journal is written soon after its match, even if the next match never ends.
    """
    writer = _Writer(folder)
    try:
        for record in records:
            writer.take(record)
            while writer.written:
                yield writer.written.popleft()
    finally:
        writer.finish()
    yield from writer.written


class _Writer:
    """Writes journals in a thread of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._name = folder, str(folder)
        self._unwritten: deque[MatchRecord] = deque()
        self.written: deque[MatchRecord] = deque()
        self._is_over = False
        self._failure: Exception | None = None
        self._changed = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def take(self, record: "MatchRecord") -> None:
        """Have a journal written, soon; wait where too many are not."""
        self._unwritten.append(record)
        if len(self._unwritten) >= _RECORDS_PER_WRITE:
            self._changed.set()
        while len(self._unwritten) > _MOST_UNWRITTEN and self._thread.is_alive():
            self._thread.join(_WRITE_EVERY_S)
        self._check()

    def finish(self) -> None:
        """Wait until all is written."""
        self._is_over = True
        self._changed.set()
        self._thread.join()
        self._check()

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _run(self) -> None:
        try:
            is_over = False
            while not is_over:
                self._changed.wait(_WRITE_EVERY_S)
                self._changed.clear()
                is_over = self._is_over
                while self._unwritten:
                    self._write(self._unwritten[0])
                    self._unwritten.popleft()
        except Exception as error:  # noqa: BLE001 - raised anew by whoever waits for the writer
            self._failure = error

    def _write(self, record: "MatchRecord") -> None:
        identity = record.plan.identity
        try:
            save_journal(self._name, identity, record.journal or b"")
        except OSError as error:
            raise InputError(f"cannot write the journal of {identity} in {self._folder}: {error.strerror}") from error
        self.written.append(replace(record, journal=None))
