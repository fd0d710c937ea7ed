"""A worker on another machine than its pit, started there by `ssh`: its pipe is what it reads and prints.

It keeps no file. What belongs into a journal goes to the pit, and whatever follows from it, to a seat or to anybody else, waits
here until the pit has written it. So all that a client ever saw stands in the pit's journal, and when this machine is lost, the
match goes on elsewhere at its very tick.
"""

import os
import time
from collections.abc import Callable
from ctypes import c_longlong
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty
from tempfile import TemporaryDirectory

from arena.network.session import Session
from arena.pit.effects import OpenMatch
from arena.pit.events import UnfinishedFound
from arena.pit.gate import Gate
from arena.pit.workers.messages import Order, Piece, Report, Stand, TakeMatch, WorkerSettings, Written
from arena.pit.workers.worker import NOBODY, WorkerLoop, work_for
from arena.records.journal import journal_name, whole_part

_SILENT_S = 20.0
"""A pit that did not wake this worker for so long is taken for lost."""


def work_afar() -> None:
    """Referee for the pit at the other end of stdin and stdout, until it says so or is gone."""
    pipe = _Streams()
    with TemporaryDirectory(prefix="arena-") as folder:  # for what is left of matches, while that is read

        def make_loop(session: Session, settings: WorkerSettings) -> WorkerLoop:
            _, _, path = settings.endpoint.partition("/")
            Path(path).unlink(missing_ok=True)  # nobody is to connect there any more
            return FarLoop(session, replace(settings, journals=Path(folder), fsync=False), pipe)

        work_for(pipe, make_loop)


class _Streams:
    """A pipe of stdin and stdout; what is printed from now on goes to stderr."""

    def __init__(self) -> None:
        self._reader, self._writer = Connection(os.dup(0), writable=False), Connection(os.dup(1), readable=False)
        self.send, self.send_bytes = self._writer.send, self._writer.send_bytes
        self.recv, self.poll = self._reader.recv, self._reader.poll
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.dup2(2, 1)
        os.close(nothing)


class _FarJournal:
    """The journal of a match, on the disk of the pit."""

    def __init__(self, effect: OpenMatch, write: Callable[[Piece], None]) -> None:
        self._match, self._name, self._n_bytes, self._write = effect.match, effect.journal, effect.n_bytes, write

    def append(self, data: bytes) -> None:
        """Send it to the pit."""
        self._write(Piece(self._match, self._name, self._n_bytes, data))
        self._n_bytes += len(data)

    def close(self) -> None:
        """Do nothing: the pit closes it."""


class FarLoop(WorkerLoop):
    """The matches of this worker, and what waits until their journals stand."""

    def __init__(self, session: Session, settings: WorkerSettings, pipe: _Streams) -> None:
        self._standing = Gate()
        super().__init__(session, settings, pipe, c_longlong(NOBODY), self._standing)

    # Threads

    def _send(self, report: Report) -> None:
        """Send a report, and all pieces that wait behind one in one message."""
        pieces: list[Piece] = []
        following: Report | None = report
        while isinstance(following, Written):
            pieces += following.pieces
            try:
                following = self._reports.get_nowait()
            except Empty:
                following = None
            else:
                if following is None:
                    self._reports.put(None)  # for the thread that ends by it
        if pieces:
            super()._send(Written(tuple(pieces)))
        if following is not None:
            super()._send(following)

    def _hear(self, order: Order) -> None:
        if isinstance(order, Stand):
            self._standing.n_standing = order.n_pieces
            self._wake()
        else:
            super()._hear(order)

    def _has_router(self) -> bool:
        return super()._has_router() and time.monotonic() - self._heard_at_s < _SILENT_S

    # The loop

    def _open_journal(self, effect: OpenMatch) -> _FarJournal:
        return _FarJournal(effect, self._write)

    def _write(self, piece: Piece) -> None:
        self._standing.n_written += 1
        self._reports.put(Written((piece,)))

    def _find_left(self, order: TakeMatch) -> UnfinishedFound | list[Report] | None:
        """Return where a match stands by what the pit has of it; what ends it here is sent to the pit."""
        if order.left is None:
            return super()._find_left(order)
        name = journal_name(order.new.header.identity)
        path = self._journals / name
        path.write_bytes(order.left)
        left = super()._find_left(order)
        found = path.read_bytes()
        path.unlink()
        if found != order.left:
            n_before = len(whole_part(order.left))
            self._write(Piece(order.match, name, n_before, found[n_before:]))
        return left
