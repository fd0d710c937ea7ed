"""A bundle of journals: many of them in one file that only grows, and where in it each stands.

    magic                                                              17 bytes
    "J"  identity (uint32)  journal (uint32)  CRC-32  identity  journal    one a match, both as they are, behind their lengths
    "I"  0                  index (uint32)    CRC-32  index                once no more come: msgpack, offsets by identity
    offset of "I" (uint64)  "JOURNALS"                                     the file's last 16 bytes

Integers are little-endian. A journal counts once the file holds it to its last byte. Whoever is killed while writing leaves a
bundle without an index, whose last record may be cut short: its journals are found from record to record, and nothing is ever
written behind them. A match that was cut short is played again, into another bundle.
"""

import errno
import os
import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import msgpack

from arena.errors import JournalError
from arena.files import MOST_BYTES as MOST_JOURNAL_BYTES
from arena.files import open_file

SUFFIX = ".journals"
MAGIC = b"ARENA-JOURNALS-1\n"
MOST_BYTES = 1 << 24
"""Of journals in one bundle, unless a single one is larger: what is copied, lost or read through at once."""
_HEAD, _TRAILER = struct.Struct("<cIII"), struct.Struct("<Q8s")
_JOURNAL, _INDEX, _END = b"J", b"I", b"JOURNALS"
_OWNER = 0o600
_MOST_INDEX_BYTES, _MOST_IDENTITY_BYTES = 1 << 26, 1 << 16


class _Head(NamedTuple):
    letter: bytes
    n_identity: int
    n_data: int
    crc: int

    @property
    def n_bytes(self) -> int:
        return _HEAD.size + self.n_identity + self.n_data


def _pack(letter: bytes, identity: bytes, data: bytes) -> bytes:
    return _HEAD.pack(letter, len(identity), len(data), crc32(data, crc32(identity))) + identity + data


class BundleWriter:
    """Writes bundles into a folder, a new one whenever the last is full; none before there is a journal. Closed by `with`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path: Path | None = None
        self._descriptor = -1
        self._n_bytes = 0
        self._offsets: dict[str, int] = {}

    def __enter__(self) -> "BundleWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, journals: Iterable[tuple[str, bytes]]) -> None:
        """Hand whole journals to the system, each behind the identity of its match: all of them, or none and `OSError`."""
        if self._n_bytes >= MOST_BYTES:
            self.close()
        if self._path is None:
            self._path, self._descriptor = _create(self._folder)
            self._offsets = {}
        pieces, offsets, at = [b"" if self._n_bytes else MAGIC], {}, self._n_bytes or len(MAGIC)
        for identity, data in journals:
            piece = _pack(_JOURNAL, identity.encode(), data)
            pieces.append(piece)
            offsets[identity] = at
            at += len(piece)
        self._append(b"".join(pieces))
        self._offsets |= offsets

    def close(self) -> None:
        """Write the index, and close the file; one without a journal goes."""
        path, self._path = self._path, None
        if path is None:
            return
        try:
            if self._offsets:
                index = _pack(_INDEX, b"", bytes(msgpack.packb(self._offsets)))
                with suppress(OSError):  # on a full disk, journals are found without it
                    self._append(index + _TRAILER.pack(self._n_bytes, _END))
            else:
                path.unlink()
        finally:
            self._n_bytes = 0
            os.close(self._descriptor)

    def _append(self, data: bytes) -> None:
        try:
            n_written = os.write(self._descriptor, data)
            if n_written != len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            os.ftruncate(self._descriptor, self._n_bytes)
            raise
        self._n_bytes += n_written


def _create(folder: Path) -> tuple[Path, int]:
    """Open a new file, whose number follows those of all bundles that are there; others may do the same meanwhile."""
    last = max((int(path.stem) for path in folder.glob(f"*{SUFFIX}") if path.stem.isascii() and path.stem.isdigit()), default=0)
    while True:
        last += 1
        with suppress(FileExistsError):
            path = folder / f"{last:06}{SUFFIX}"
            return path, os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, _OWNER)


class Bundle:
    """A bundle's file, read; it may grow meanwhile. `OSError` if it cannot be read, `JournalError` if it is none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._offsets: dict[str, int] = {}
        self._n_bytes, self._at, self._is_whole = 0, 0, False
        """Of the file, when it was looked at last; where the next record begins; whether it has an index, and grows no more."""

    def __contains__(self, identity: str) -> bool:
        return identity in self._offsets

    def __iter__(self) -> Iterator[str]:
        return iter(self._offsets)

    def look(self) -> None:
        """Find the journals that are in the file by now."""
        if self._is_whole or self.path.stat().st_size == self._n_bytes:
            return
        with open_file(self.path) as file:
            descriptor = file.fileno()
            n_bytes = os.fstat(descriptor).st_size
            if not self._at:
                if not _has_begun(self.path, os.pread(descriptor, len(MAGIC), 0)):
                    return
                self._at = len(MAGIC)
            index = _read_index(descriptor, n_bytes)
            if index is None:
                self._scan(descriptor, n_bytes)
            else:
                self._offsets, self._is_whole = index, True
            self._n_bytes = n_bytes

    def read(self, identity: str, most_bytes: int = MOST_JOURNAL_BYTES) -> bytes:
        """Return the journal of a match that is in here; `JournalError` if it was changed, or is larger."""
        name = identity.encode(errors="surrogateescape")
        with open_file(self.path) as file:
            at = self._offsets[identity]
            head = _read_head(file.fileno(), at)
            is_ours = head is not None and head.letter == _JOURNAL and head.n_data <= most_bytes and head.n_identity == len(name)
            rest = os.pread(file.fileno(), head.n_bytes - _HEAD.size, at + _HEAD.size) if head and is_ours else b""
        if head is None or crc32(rest) != head.crc or rest[: head.n_identity] != name:
            raise JournalError(f"the journal of {identity} in the bundle {self.path.name} was changed")
        return rest[head.n_identity :]

    def _scan(self, descriptor: int, n_bytes: int) -> None:
        """Go on from record to record, as far as they are whole."""
        while (head := _read_head(descriptor, self._at)) is not None and self._at + head.n_bytes <= n_bytes:
            if head.letter == _JOURNAL:
                identity = os.pread(descriptor, head.n_identity, self._at + _HEAD.size)
                self._offsets[identity.decode(errors="surrogateescape")] = self._at
            self._at += head.n_bytes


def _has_begun(path: Path, first: bytes) -> bool:
    """Whether a file has its first line; one that was just made may lack it."""
    if MAGIC.startswith(first):
        return first == MAGIC
    made, version = MAGIC.rpartition(b"-")[0], first.rpartition(b"-")[2].strip()
    if first.startswith(made) and version.isdigit():
        raise JournalError(
            f"the bundle {path} is of format {int(version)}, which this arena does not know; install a newer arena"
        )
    raise JournalError(f"{path} is no bundle of journals: its first line is another")


def _read_head(descriptor: int, at: int) -> _Head | None:
    data = os.pread(descriptor, _HEAD.size, at)
    head = _Head(*_HEAD.unpack(data)) if len(data) == _HEAD.size else None
    is_one = head is not None and head.letter in (_JOURNAL, _INDEX) and head.n_identity <= _MOST_IDENTITY_BYTES
    return head if is_one else None


def _read_index(descriptor: int, n_bytes: int) -> dict[str, int] | None:
    """Return the index at a file's end, if it is there and was not changed."""
    trailer = os.pread(descriptor, _TRAILER.size, max(n_bytes - _TRAILER.size, 0))
    if not trailer.endswith(_END) or len(trailer) < _TRAILER.size:
        return None
    at, _ = _TRAILER.unpack(trailer)
    head = _read_head(descriptor, at) if at < n_bytes else None
    if head is None or at + head.n_bytes + _TRAILER.size != n_bytes or head.n_data > _MOST_INDEX_BYTES:
        return None
    data = os.pread(descriptor, head.n_data, at + _HEAD.size)
    if head.letter != _INDEX or crc32(data) != head.crc:
        return None
    with suppress(ValueError, msgpack.UnpackException):
        found = msgpack.unpackb(data)
        if isinstance(found, dict) and all(isinstance(place, int) and 0 <= place < n_bytes for place in found.values()):
            return found
    return None
