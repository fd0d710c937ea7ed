"""The journals that workers on other machines write, in the pit's own folder."""

from pathlib import Path

from arena.files import keep_former, read_file
from arena.pit.journal_files import JournalFile, OpenJournals
from arena.pit.journal_sync import sync_records
from arena.pit.workers.messages import Piece, Stand, TakeMatch, Written
from arena.records.journal import journal_name

_MOST_OPEN = 64


class JournalCopies:
    """Writes what one process of a worker sends, as a match of this process writes its own."""

    def __init__(self, folder: Path, *, fsync: bool) -> None:
        self._folder, self._fsync = folder, fsync
        self._open = OpenJournals(_MOST_OPEN)
        self._journals: dict[str, JournalFile] = {}
        """By match."""
        self._n_pieces = 0

    def write(self, written: Written) -> Stand:
        """Append all of it; return what the worker is told then.

        Raises
        ------
        ArenaError
            It cannot be written.
        """
        for piece in written.pieces:
            journal = self._journals.get(piece.match)
            if journal is None:
                journal = self._journals[piece.match] = self._begin(piece)
            journal.append(piece.data)
        if self._fsync:
            sync_records(self._journals[piece.match] for piece in written.pieces)
        self._n_pieces += len(written.pieces)
        return Stand(self._n_pieces)

    def _begin(self, piece: Piece) -> JournalFile:
        path = self._folder / piece.journal
        if piece.n_before:
            return JournalFile(path, piece.n_before, among=self._open)
        keep_former(path)
        journal = JournalFile(path.with_name(f".spare-{piece.match}"), 0, among=self._open)
        journal.rename_when_written(path)
        return journal

    def shut(self, match: str) -> None:
        """Close the journal of a match."""
        journal = self._journals.pop(match, None)
        if journal is not None:
            journal.close()

    def close(self) -> None:
        """Close all of them as they stand."""
        while self._journals:
            self._journals.popitem()[1].close()


def read_left(order: TakeMatch, folder: Path) -> bytes | None:
    """Return the journal of a match that is to be taken up, if it was begun; what cannot be read is told as what is not whole."""
    try:
        return read_file(folder / journal_name(order.new.header.identity))
    except FileNotFoundError:
        return None
    except OSError:
        return b""
