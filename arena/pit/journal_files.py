"""The journals of a pit as files: written ahead, read piece by piece, and found again after the pit was killed."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path

from arena.errors import ArenaError, JournalError
from arena.files import read_file
from arena.pit.events import UnfinishedFound
from arena.protocol.codec import encode
from arena.protocol.messages import JournalPiece, Refusal
from arena.records.journal import read_journal, whole_part

logger = logging.getLogger(__name__)

PIECE_BYTES = 50_000


class JournalFile:
    """A journal that is being written. Whatever cannot be written raises `ArenaError`."""

    def __init__(self, path: Path, n_bytes: int, *, fsync: bool) -> None:
        self._fsync = fsync
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            os.ftruncate(self._descriptor, n_bytes)
        except OSError as error:
            raise ArenaError(f"cannot write a journal: {error.strerror}") from error

    def append(self, data: bytes) -> None:
        """Hand bytes to the system, all or nothing."""
        try:
            n_written = os.write(self._descriptor, data)
            if self._fsync:
                os.fdatasync(self._descriptor)
        except OSError as error:
            raise ArenaError(f"cannot write a journal: {error.strerror}") from error
        if n_written != len(data):
            raise ArenaError("cannot write a journal: the disk is full")

    def close(self) -> None:
        """Close the file as it stands."""
        os.close(self._descriptor)


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


def find_unfinished(folder: Path) -> Iterator[UnfinishedFound]:
    """Yield the matches that a pit left unfinished."""
    for path in sorted(folder.glob("*.journal")):
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
            yield UnfinishedFound(path.name, journal, journal.seals.entries, len(whole))
