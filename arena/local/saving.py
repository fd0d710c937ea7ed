"""The journals of local matches, written beside the games: a file each, or many in a bundle."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING

from arena.errors import InputError
from arena.files import keep_former
from arena.folders import make_folder
from arena.records.journal import journal_name, save_journal
from arena.records.journal_bundle import BundleWriter

if TYPE_CHECKING:
    from arena.local.venue import MatchRecord

MOST_FILES = 600
"""Matches of one call that have a file each, for whoever looks at one. Of more, files would cost more than the matches: their
journals go into bundles."""
_RECORDS_PER_WRITE, _MOST_UNWRITTEN = 256, 1024
_WRITE_EVERY_S = 0.1


def make_journals_folder(folder: Path) -> None:
    """Make the folder of journals, unless it is there; `InputError` if it cannot be."""
    make_folder(folder, f"cannot keep journals in {folder}")


def save(records: Iterable["MatchRecord"], folder: Path, *, bundled: bool = False) -> Iterator["MatchRecord"]:
    """Yield records once their journals are written, by a thread beside the games: the disk may take its time.

    A journal is written soon after its match, even if the next match never ends.
    """
    writer = _Writer(folder, bundled=bundled)
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

    def __init__(self, folder: Path, *, bundled: bool) -> None:
        self._folder, self._name = folder, str(folder)
        self._files = {path.name for path in folder.glob("*.journal")} if bundled else set()
        """That are there already, and would count before a bundle."""
        self._closing = ExitStack()
        self._bundle = self._closing.enter_context(BundleWriter(folder)) if bundled else None
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
            with self._closing:
                while not is_over:
                    self._changed.wait(_WRITE_EVERY_S)
                    self._changed.clear()
                    is_over = self._is_over
                    while self._unwritten:
                        n_taken = min(len(self._unwritten), _RECORDS_PER_WRITE)  # others come meanwhile
                        some = [self._unwritten[number] for number in range(n_taken)]
                        self._write(some)
                        for record in some:
                            self._unwritten.popleft()
                            self.written.append(record.without_journal())
        except Exception as error:  # noqa: BLE001 - raised anew by whoever waits for the writer
            self._failure = error

    def _write(self, records: Sequence["MatchRecord"]) -> None:
        first = last = records[0].plan.identity
        try:
            if self._bundle is not None:
                self._keep_former(records)
                last = records[-1].plan.identity
                self._bundle.add((record.plan.identity, record.journal or b"") for record in records)
                return
            for record in records:
                first = last = record.plan.identity
                save_journal(self._name, first, record.journal or b"")
        except OSError as error:
            which = f"the journal of {first}" if first == last else f"the journals of {first} to {last}"
            raise InputError(f"cannot write {which} in {self._folder}: {error.strerror}") from error

    def _keep_former(self, records: Sequence["MatchRecord"]) -> None:
        for record in records if self._files else ():
            name = journal_name(record.plan.identity)
            if name in self._files:
                keep_former(self._folder / name)
