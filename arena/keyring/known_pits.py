"""Trust at first use, as ssh does: a pit's key is remembered, and a changed one refused.

The file `known_pits` has a line for each, `HOST:PORT/PIT PUBLICKEY`; empty lines and those that begin with # are left alone.
"""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock

from arena.errors import InputError, KeyFileError, UnknownNameError
from arena.keyring.files import draft, make_folder
from arena.keyring.ring import config_folder
from arena.protocol.identity import from_text, to_text

_PIT = re.compile(r"[^\s#]\S*/[A-Za-z0-9_-]{1,64}")


def check_pit(where: str, public: bytes, expected: bytes | None) -> bool:
    """Check that a pit is the one that it was, or remember it.

    Parameters
    ----------
    where
        HOST:PORT/PIT.
    public
        The key under which the pit signs, which the caller has checked; 32 bytes.
    expected
        The key in the pit's address, if that has one; then nothing is remembered.

    Returns
    -------
    bool
        Whether the pit is newly trusted.

    Raises
    ------
    KeyFileError
        The key is not the expected one, or not the remembered one; or the file of known pits cannot be used.
    """
    _check_place(where)
    if expected is not None:
        if public != expected:
            raise KeyFileError(
                f"the pit at {where} has the key {to_text(public)}, the address says {to_text(expected)}: another pit stands "
                "there, or the address is old; ask the operator for the address of today"
            )
        return False  # the address is worth more than what was remembered
    if _is_known(where, public, _read()):
        return False
    with _locked():
        lines = _read()
        if _is_known(where, public, lines):  # another process was quicker
            return False
        _write([*lines, f"{where} {to_text(public)}"])
    return True


def known_pits() -> dict[str, bytes]:
    """Return the public key of every pit that is trusted."""
    return _parse(_read())


def forget(where: str) -> None:
    """Trust whatever key the pit has next.

    Raises
    ------
    UnknownNameError
        No such pit is known.
    """
    known = known_pits()
    if not known:
        raise InputError(f"no pit is known, so {where!r} is none to forget")
    if where not in known:
        raise UnknownNameError("pit", where, known)
    with _locked():
        lines = _read()
        _parse(lines)
        _write([line for line in lines if line.split()[:1] != [where]])


def _check_place(where: str) -> None:
    if not (_PIT.fullmatch(where) and where.isprintable()):
        raise InputError(f"{where!r} is no pit; write HOST:PORT/PIT")


def _is_known(where: str, public: bytes, lines: list[str]) -> bool:
    known = _parse(lines).get(where)
    if known is not None and known != public:
        raise KeyFileError(
            f"the key of the pit at {where} has changed from {to_text(known)} to {to_text(public)}: either its operator made "
            "a new one, or somebody stands between you and the pit; ask the operator, and if the new key is right: "
            f"arena keys forget {where}"
        )
    return known is not None


def _path() -> Path:
    return config_folder() / "known_pits"


def _read() -> list[str]:
    try:
        data = _path().read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise KeyFileError(f"cannot read the known pits in {_path()}: {error.strerror}; mend that file") from error
    lines = data.decode("utf-8", "surrogateescape").split("\n")  # a comment may be in any encoding, and is kept
    return lines if lines[-1] else lines[:-1]


def _parse(lines: list[str]) -> dict[str, bytes]:
    known: dict[str, bytes] = {}
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            where, key = line.split()
            _check_place(where)
            public = from_text(key)
        except (InputError, ValueError) as error:
            raise KeyFileError(f"line {number} of {_path()} is not HOST:PORT/PIT PUBLICKEY; mend or remove it") from error
        if known.setdefault(where, public) != public:
            raise KeyFileError(f"line {number} of {_path()} gives {where} another key than a line before; remove one of them")
    return known


def _write(lines: list[str]) -> None:
    path = Path(os.path.realpath(_path()))  # a link to the file stays one
    try:
        with draft(path, "".join(f"{line}\n" for line in lines).encode("utf-8", "surrogateescape")) as whole:
            whole.replace(path)
    except OSError as error:
        raise KeyFileError(f"cannot write the known pits in {path}: {error.strerror}; mend its folder") from error


@contextmanager
def _locked() -> Iterator[None]:
    """Let one process at a time read and write; the system takes the lock from one that dies."""
    path = _path().with_suffix(".lock")
    try:
        make_folder(path.parent)
        lock = FileLock(path, mode=0o600).acquire()
    except OSError as error:
        raise KeyFileError(f"cannot lock the known pits by {path}: {error.strerror}; mend its folder") from error
    with lock:
        yield
