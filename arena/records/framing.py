"""What the files of one match are made of, the referee's journal and a seat's transcript: frames, links, and how each is read.

A frame is a letter, a length (uint32, little-endian) and that many bytes of msgpack. What was cut or changed is a `JournalError`
that names the kind of file.
"""

import struct
from collections.abc import Callable
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol, TypeVar

import msgpack

from arena.errors import InputError, JournalError
from arena.files import read_file
from arena.game.ruleset import Ruleset, from_dict
from arena.game.types import RULES_VERSION
from arena.policy import MatchResult

_LENGTH = struct.Struct("<I")
_MAX_FRAME = 1 << 20
_ENDINGS_KNOWN = 4096
"""Most matches end like one before."""
_READING = (ValueError, KeyError, TypeError, AttributeError, InputError, msgpack.UnpackException)
"""What values that another wrote may raise."""


class _Packs(Protocol):
    def pack(self) -> bytes: ...


Read = TypeVar("Read")
PackedHeader = TypeVar("PackedHeader", bound=_Packs)


def link(chain: bytes, *parts: bytes) -> bytes:
    """Return the next link of a chain."""
    return sha256(chain + b"".join(parts)).digest()


def pack_frame(letter: bytes, data: bytes) -> bytes:
    """Return a frame's bytes."""
    return letter + _LENGTH.pack(len(data)) + data


class CutShortError(JournalError):
    """A file ends within a record."""


class FrameReader:
    """Takes bytes from the front, and says where they ran out."""

    def __init__(self, data: bytes, kind: str) -> None:
        self._data, self._at, self._kind = data, 0, kind

    @property
    def left(self) -> int:
        """Bytes that were not taken."""
        return len(self._data) - self._at

    def peek(self) -> bytes:
        """Return the next byte, or none at the end."""
        return self._data[self._at : self._at + 1]

    def take(self, n_bytes: int, where: str) -> bytes:
        """Return the next bytes; `JournalError` if there are not so many."""
        piece = self._data[self._at : self._at + n_bytes]
        if len(piece) < n_bytes:
            raise CutShortError(f"the {self._kind} is truncated: it ends at byte {len(self._data)}, within {where}")
        self._at += n_bytes
        return piece

    def take_frame(self, where: str) -> bytes:
        """Return what stands in the next frame, whose letter was taken."""
        (length,) = _LENGTH.unpack(self.take(_LENGTH.size, where))
        if length > _MAX_FRAME:
            raise JournalError(f"the {self._kind} was changed: {where} claims {length} bytes")
        return self.take(length, where)

    def take_start(self, magic: bytes) -> bytes:
        """Return the packed header, which stands behind the first line."""
        first = self.take(len(magic), "its first line")
        if first != magic:
            made, _, version = first.rpartition(b"-")
            if made == magic.rpartition(b"-")[0] and version.strip().isdigit():
                raise JournalError(
                    f"the {self._kind} is of format {int(version)}, which this arena does not know; install a newer arena"
                )
            raise JournalError(f"this is not a {self._kind}: its first line is another")
        if self.take(1, "its header") != b"H":
            raise JournalError(f"the {self._kind} was changed: it does not begin with a header")
        return self.take_frame("its header")


def read_header(data: bytes, kind: str, make: Callable[[dict[str, Any], Ruleset], PackedHeader]) -> PackedHeader:
    """Return what `make` makes of a packed header's values and rules.

    Raises
    ------
    JournalError
        The bytes are no header, or one of another version of the rules.
    """
    try:
        values = msgpack.unpackb(data)
        version = values["rules_version"]
        if version != RULES_VERSION:
            raise JournalError(f"the {kind} was written under version {version} of the rules; this is version {RULES_VERSION}")
        rules = dict(values["ruleset"])
        header = make(values, from_dict(rules.pop("name"), rules))
        if header.pack() != data:  # the same facts in other bytes would give one match two canonical journals
            raise JournalError(f"the {kind}'s header was changed: its bytes are not as the arena writes them")
        return header
    except JournalError:
        raise
    except _READING as error:
        raise JournalError(f"the {kind}'s header was changed: {error!r} on reading it") from error


@lru_cache(maxsize=_ENDINGS_KNOWN)
def pack_ending(result: MatchResult) -> bytes:
    """Return the bytes of how a match ended."""
    return bytes(msgpack.packb(result.to_dict()))


def read_ending(data: bytes, kind: str) -> MatchResult:
    """Return what `pack_ending` wrote; `JournalError` if it was changed."""
    try:
        result = MatchResult.from_dict(msgpack.unpackb(data))
        if [type(value) for value in (result.score, result.ticks, result.reason)] != [int, int, str]:
            raise JournalError(f"the {kind}'s ending was changed: a number is none, or its reason is no text")
        if pack_ending(result) != data:
            raise JournalError(f"the {kind}'s ending was changed: its bytes are not as the arena writes them")
        return result
    except JournalError:
        raise
    except _READING as error:
        raise JournalError(f"the {kind}'s ending was changed: {error!r} on reading it") from error


def load(path: Path, read: Callable[[bytes], Read], fetch: Callable[[Path], bytes] = read_file) -> Read:
    """Read a file, which `fetch` returns the bytes of; errors name it."""
    try:
        return read(fetch(path))
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder; name one of the files in it") from error
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except JournalError as error:
        raise JournalError(f"{path}: {error}") from error
