"""Read files that a stranger may have made: regular ones alone, and no more bytes than such a file can have. Write over none."""

import logging
import os
import stat
import tomllib
from errno import EFBIG, EINVAL, EISDIR
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

logger = logging.getLogger(__name__)

MOST_BYTES = 1 << 26
"""More than any journal or transcript has."""
MOST_TEXT_BYTES = 1 << 20
"""More than any file that a person writes has."""
_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}
_FLAGS = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY
"""Without them, opening a pipe waits for somebody who writes to it."""


def read_file(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """Return what a file holds.

    Raises
    ------
    OSError
        It cannot be read, is no regular file, or has more bytes than `most_bytes`; `strerror` says which.
    """
    with open_file(path, most_bytes) as file:
        data = file.read(most_bytes + 1)  # some files say that they have 0 bytes, and others grow
    if len(data) > most_bytes:
        raise _too_large(most_bytes)
    return data


def open_file(path: Path, most_bytes: int | None = None) -> BinaryIO:
    """Open a file to read some of it; raises as `read_file` does, for too many bytes only where a most is given."""
    descriptor = os.open(path, _FLAGS)
    try:
        _check(os.fstat(descriptor), most_bytes)
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def read_text(path: Path) -> str:
    """Return what a file that a person wrote holds; raises as `read_file` does, and `UnicodeDecodeError` if it is not UTF-8."""
    return read_file(path, MOST_TEXT_BYTES).decode("utf-8").replace("\r\n", "\n")


def mode_of(path: Path) -> int:
    """Return the `st_mode` of what somebody names; 0 where nothing is there, or where it is out of reach, or no path at all."""
    try:
        return path.stat().st_mode
    except (OSError, ValueError):  # it may be the text of a program, too long for a path
        return 0


def check_file(path: Path, most_bytes: int) -> int:
    """Return how many bytes a file has that a library is to open by its path; raises as `read_file` does."""
    found = path.stat()
    _check(found, most_bytes)
    return found.st_size


def _check(found: os.stat_result, most_bytes: int | None) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise OSError(EISDIR, os.strerror(EISDIR))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(EINVAL, f"it is {_KINDS.get(stat.S_IFMT(found.st_mode), 'something else')}, not a file")
    if most_bytes is not None and found.st_size > most_bytes:
        raise _too_large(most_bytes)


def _too_large(most_bytes: int) -> OSError:
    return OSError(EFBIG, f"it is larger than {most_bytes:,} bytes")


def parse_toml(text: str) -> dict[str, Any]:
    """Return what a text in TOML says, whoever wrote it; `ValueError`, in a few words, if it is none."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None


def keep_former(path: Path, data: bytes = b"") -> None:
    """Give a file that is there the first free number behind its name, unless it holds `data`: nothing is written over.

    A journal may be there: of a match that was void and is played again, or one that does not hold.
    """
    if not os.path.lexists(path) or path.is_dir() or (data and _holds(path, data)):
        return  # of a folder, whoever opens it says that it is one
    free = next(free for number in count(1) if not os.path.lexists(free := path.with_name(f"{path.name}.{number}")))
    path.rename(free)
    logger.info("%s was there already, and is %s now", path, free.name)


def _holds(path: Path, data: bytes) -> bool:
    try:
        return read_file(path, len(data)) == data
    except OSError:
        return False
