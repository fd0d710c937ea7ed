"""The journals of matches that are over, for whoever asks, once they may be seen."""

from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

from arena.errors import ProtocolError
from arena.protocol.codec import decode, encode
from arena.protocol.messages import JournalPiece, JournalRequest, Refusal, Wait
from arena.records.journal import Header, journal_name

PIECE_BYTES = 50_000
MOST_KEPT = 10_000
"""Matches that are remembered; the journals of older ones are on the disk alone."""


class Archive:
    """Answers questions about journals."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: OrderedDict[str, tuple[Path, Callable[[], bool]]] = OrderedDict()

    def add(self, match: str, header: Header, is_open: Callable[[], bool]) -> None:
        """Keep a journal that is whole; `is_open` says whether it may be seen."""
        self._files[match] = self._folder / journal_name(header.identity), is_open
        if len(self._files) > MOST_KEPT:
            self._files.popitem(last=False)

    def answer(self, match: str, payload: bytes) -> bytes:
        """Return the piece that is asked for, or why not."""
        try:
            request = decode(payload)
        except ProtocolError as error:
            return encode(Refusal(reason=f"the request cannot be read: {error}"))
        if not isinstance(request, JournalRequest) or request.offset < 0:
            return encode(Refusal(reason="this is no request for a journal"))
        if match not in self._files:
            return encode(Refusal(reason=f"there is no journal of a match {match}, or the match is not over"))
        path, is_open = self._files[match]
        if not is_open():
            return encode(Wait(reason="until the last match of these two is over"))
        try:
            with path.open("rb") as file:
                n_bytes = file.seek(0, 2)
                file.seek(min(request.offset, n_bytes))
                data = file.read(PIECE_BYTES)
        except OSError as error:
            return encode(Refusal(reason=f"the journal cannot be read: {error.strerror}"))
        return encode(JournalPiece(n_bytes=n_bytes, offset=request.offset, data=data))
