"""The journals of a pit as files: written ahead, read piece by piece, and found again after the pit was killed."""

import errno
import logging
import os
from collections import OrderedDict
from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path

from arena.errors import ArenaError, JournalError
from arena.files import keep_former, read_file
from arena.pit.events import UnfinishedFound
from arena.protocol.codec import encode
from arena.protocol.messages import JournalPiece, Refusal
from arena.records.journal import journal_name, read_journal, whole_part

logger = logging.getLogger(__name__)

PIECE_BYTES = 50_000
MOST_SPARE = 8
MOST_OPEN = 128
"""Journals of a process that are open at once, those to spare among them; another is opened for each write."""
_SPARE = ".spare-"
_CLOSED = -1
"""In place of the number of a journal that is written no more."""


class OpenJournals:
    """The journals of a process that are open: those written to last, so that many matches need no more files than few."""

    def __init__(self, most: int = MOST_OPEN) -> None:
        self._most = most
        self.descriptors: OrderedDict[int, int] = OrderedDict()
        """By the number of the journal, the one that was written to last behind all others."""
        self._numbers = count()

    def add(self, path: Path, flags: int) -> int:
        """Open a journal, and return its number."""
        number = next(self._numbers)
        self._open(number, path, flags)
        return number

    def find(self, number: int, path: Path) -> int:
        """Return the descriptor of a journal, opening it again if others have taken its place."""
        if number == _CLOSED:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        descriptor = self.descriptors.get(number)
        if descriptor is None:
            return self._open(number, path, 0)
        self.descriptors.move_to_end(number)
        return descriptor

    def close(self, number: int) -> None:
        """Close a journal, if it is open."""
        descriptor = self.descriptors.pop(number, None)
        if descriptor is not None:
            os.close(descriptor)

    def _open(self, number: int, path: Path, flags: int) -> int:
        """Open a journal, and close others for it as far as is needed."""
        while len(self.descriptors) >= self._most:
            self._close_one()
        while True:
            try:
                descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | flags, 0o600)
            except OSError as error:
                if error.errno not in (errno.EMFILE, errno.ENFILE) or not self.descriptors or flags:
                    raise
                self._close_one()
            else:
                self.descriptors[number] = descriptor
                return descriptor

    def _close_one(self) -> None:
        self.close(next(iter(self.descriptors)))


class JournalFile:
    """A journal that is being written. Whatever cannot be written raises `ArenaError`."""

    def __init__(self, path: Path, n_bytes: int, *, among: OpenJournals | None = None) -> None:
        self.path, self._name = path, path
        self._open = OpenJournals() if among is None else among
        self._is_to_be_named = False
        self.has_new_name = False
        """Whether it was named since anybody last cared; a name stands in the folder, which a disk gets by itself."""
        try:
            self._number = self._open.add(path, os.O_CREAT)
            os.ftruncate(self._open.find(self._number, path), n_bytes)
        except OSError as error:
            raise failure_of(error) from error

    def rename_when_written(self, name: Path) -> None:
        """Take another name with the first bytes that are appended; without any, `close` removes the file."""
        self._name, self._is_to_be_named = name, True

    def append(self, data: bytes) -> None:
        """Hand bytes to the system, all or nothing."""
        try:
            descriptor = self._open.find(self._number, self.path)
            n_written = os.write(descriptor, data)
            if self._is_to_be_named and n_written == len(data):
                keep_former(self._name)
                self.path, self._is_to_be_named = self.path.rename(self._name), False
                self.has_new_name = True
        except OSError as error:
            raise failure_of(error) from error
        if n_written != len(data):
            raise ArenaError("cannot write a journal: the disk is full")

    def close(self) -> None:
        """Close the file as it stands."""
        self._open.close(self._number)
        self._number = _CLOSED
        if self._is_to_be_named:
            self.path.unlink(missing_ok=True)


def failure_of(error: OSError) -> ArenaError:
    """Return what ends a pit whose journals cannot be written."""
    return ArenaError(f"cannot write a journal: {error.strerror}")


class SpareJournals:
    """Files that are open for the next matches, so that no match begins whose journal cannot be opened.

    Parameters
    ----------
    name
        Sets those of one process apart from those of others that write into the same folder; none is the beginning of another.
    """

    def __init__(self, folder: Path, *, name: str = "", among: OpenJournals | None = None) -> None:
        self._open = OpenJournals() if among is None else among
        self._folder, self._prefix = folder, f"{_SPARE}{name}"
        self._spare: list[JournalFile] = []
        self._numbers = count()
        self._has_failed = False
        for left in folder.glob(f"{self._prefix}*"):  # by a pit that was killed
            left.unlink(missing_ok=True)

    def __len__(self) -> int:
        return len(self._spare)

    def refill(self) -> None:
        """Open as many as are kept; fewer where the system has no descriptor or no inode left, until it has."""
        while len(self._spare) < MOST_SPARE:
            path = self._folder / f"{self._prefix}{next(self._numbers)}"
            try:
                spare = JournalFile(path, 0, among=self._open)
            except ArenaError as error:
                if not self._has_failed:
                    logger.warning("no match begins for now: %s", error)
                self._has_failed = True
                return
            spare.rename_when_written(path.with_suffix(".unused"))
            self._spare.append(spare)
        self._has_failed = False

    def take(self, name: str) -> JournalFile:
        """Return one, which is to have a name once it is written."""
        journal = self._spare.pop()
        journal.rename_when_written(self._folder / name)
        return journal

    def close(self) -> None:
        """Remove all that no match has taken."""
        while self._spare:
            self._spare.pop().close()


def read_piece(path: Path, offset: int) -> bytes:
    """Return the answer to a request for a piece of a journal."""
    try:
        with path.open("rb") as file:
            n_bytes = file.seek(0, 2)
            file.seek(min(offset, n_bytes))
            data = file.read(PIECE_BYTES)
    except OSError as error:
        return encode(Refusal(reason=f"the journal cannot be read: {error.strerror}"))
    return encode(JournalPiece(n_bytes=n_bytes, offset=offset, data=data))


def find_unfinished(folder: Path, identities: Iterable[str] | None = None) -> Iterator[UnfinishedFound]:
    """Yield the matches that a pit left unfinished: all, or those of some identities."""
    if identities is None:
        paths = sorted(folder.glob("*.journal"))
    else:
        paths = [path for identity in identities if (path := folder / journal_name(identity)).exists()]
    for path in paths:
        try:
            whole = whole_part(read_file(path))
            journal = read_journal(whole)
        except JournalError as error:
            logger.warning("%s cannot be resumed: %s", path.name, error)
            continue
        except OSError as error:
            logger.warning("%s cannot be resumed: %s", path.name, error.strerror)
            continue
        if journal.ending is None and journal.seals is not None:
            yield UnfinishedFound(path.name, journal, journal.seals.entries, journal.seals.nonce, len(whole))
