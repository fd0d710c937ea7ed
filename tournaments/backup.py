"""A whole data folder and its store in one file, taken while a pit, a season or a league goes on, and back.

The file is a tar.gz: `manifest.json`, then the store's tables as lines of JSON, then the folder's files. The store is copied as
it stands at one moment, and before the journals, so that every result of a backup has its journal. A journal that is being
written ends where a killed process might have left it, and is taken up again just so.
"""

import gzip
import json
import os
import shutil
import stat
import tarfile
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import IO, Any

from sqlalchemy.exc import NoSuchTableError

from arena.errors import InputError
from arena.folders import data_folder
from tournaments.store.copies import CopiedStore, TableLines, fill

_FORMAT = 1
_LEVEL = 3
"""Of compression: a journal is mostly hashes, which no level makes small."""
_IN_MEMORY = 1 << 26
_MANIFEST, _STORE, _DATA = "manifest.json", "store/", "data/"
_PASSING = (".lock", ".draft")
"""Ends of names of files that only a running process needs."""
_SPARE = ".spare-"
"""How files begin that wait for a match that has not begun."""
_OWNER = 0o600
_FLAGS = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
_UNREADABLE = (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile, ValueError, KeyError, TypeError, NoSuchTableError)


@dataclass(frozen=True, slots=True, kw_only=True)
class Copied:
    """What was taken, or laid out again."""

    n_files: int
    n_rows: int | None
    """Of the store; None if there is none."""
    left_out: tuple[str, ...] = ()
    """What is neither a file nor a folder: a link leads to what may not be ours, and a pipe to nothing."""


def back_up(file: Path, folder: Path, db: str) -> Copied:
    """Write a backup of a folder, and of the store at `db`, the one in the folder if that is empty.

    Raises
    ------
    InputError
        The file is there already or cannot be written, or the store cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"there is no data folder {folder} to be backed up; name it with --data")
    if file.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"{file} lies in {folder}, which it is a backup of; name a file elsewhere")
    own, real = folder / "arena.db", folder.resolve()
    store = db or (str(own) if own.exists() else "")
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _OWNER)
    except OSError as error:
        raise InputError(f"cannot write the backup {file}: {error.strerror}; name another file") from error
    try:
        with os.fdopen(descriptor, "wb") as raw, tarfile.open(fileobj=raw, mode="w:gz", compresslevel=_LEVEL) as tar:
            n_rows, own_file = _write_store(tar, store)
            of_store = {f"{own_file}{end}" for end in ("", "-wal", "-shm", "-journal")}  # which SQLite lays beside it
            return _write_files(tar, folder, lambda path: str(real / path) in of_store, n_rows)
    except BaseException as error:
        file.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"cannot write the backup {file}: {error.strerror or error}") from error
        raise


def _write_store(tar: tarfile.TarFile, store: str) -> tuple[int | None, str | None]:
    """Write the manifest, and every table of a store; return how many rows it has, and its file if it is one."""
    facts: dict[str, Any] = {"format": _FORMAT, "arena": version("arena-pit"), "store": None}
    if not store:
        _add_manifest(tar, facts)
        return None, None
    with CopiedStore(store, make=False) as copied, copied.tables() as (facts["store"], tables):
        _add_manifest(tar, facts)
        n_rows = 0
        for name, lines in tables:
            with tempfile.SpooledTemporaryFile(_IN_MEMORY) as spool:
                for line in lines:
                    spool.write(line)
                    n_rows += 1
                _add(tar, tarfile.TarInfo(f"{_STORE}{name}"), spool)
            n_rows -= 1  # the first line names the columns
        return n_rows, copied.file


def _write_files(tar: tarfile.TarFile, folder: Path, is_stored: Callable[[PurePosixPath], bool], n_rows: int | None) -> Copied:
    n_files, left_out = 0, []
    for where, folders, files, descriptor in os.fwalk(folder):
        below = PurePosixPath(Path(where).relative_to(folder))
        for name in sorted(folders + files):
            path = below / name
            if name.endswith(_PASSING) or name.startswith(_SPARE) or is_stored(path):
                continue
            with suppress(FileNotFoundError):  # it went away since the folder was read
                found = os.stat(name, dir_fd=descriptor, follow_symlinks=False)
                info = tarfile.TarInfo(f"{_DATA}{path}")
                info.mode, info.mtime = stat.S_IMODE(found.st_mode) & 0o777, int(found.st_mtime)
                if stat.S_ISDIR(found.st_mode):
                    info.type = tarfile.DIRTYPE
                    tar.addfile(info)
                elif stat.S_ISREG(found.st_mode):
                    _write_file(tar, info, os.open(name, _FLAGS, dir_fd=descriptor))
                    n_files += 1
                else:
                    left_out.append(str(path))
    return Copied(n_files=n_files, n_rows=n_rows, left_out=tuple(left_out))


def _write_file(tar: tarfile.TarFile, info: tarfile.TarInfo, descriptor: int) -> None:
    """Write a file as it stands, however it grows or shrinks meanwhile."""
    with os.fdopen(descriptor, "rb") as source, tempfile.SpooledTemporaryFile(_IN_MEMORY) as spool:
        shutil.copyfileobj(source, spool)
        _add(tar, info, spool)


def _add_manifest(tar: tarfile.TarFile, facts: dict[str, Any]) -> None:
    with BytesIO(json.dumps(facts).encode()) as spool:
        spool.seek(0, os.SEEK_END)
        _add(tar, tarfile.TarInfo(_MANIFEST), spool)


def _add(tar: tarfile.TarFile, info: tarfile.TarInfo, spool: IO[bytes]) -> None:
    info.size = spool.tell()
    spool.seek(0)
    tar.addfile(info, spool)


def restore(file: Path, folder: Path, db: str) -> Copied:
    """Lay out what a backup holds in a folder that is empty, and in a store that is, the one in the folder without `db`.

    Raises
    ------
    InputError
        The file is no backup, or not all of one; the folder or the store holds something. Then neither is changed.
    """
    was_there = folder.exists()
    data_folder(folder)
    if any(folder.iterdir()):
        raise InputError(f"{folder} is not empty; restore into a new folder, with --data")
    try:
        with file.open("rb") as raw, tarfile.open(fileobj=raw, mode="r|gz") as tar:
            return _lay_out(tar, folder, db or str(folder / "arena.db"))
    except BaseException as error:
        _empty(folder, keep=was_there)
        if isinstance(error, OSError) and error.filename == str(file):
            raise InputError(f"cannot read {file}: {error.strerror}") from error
        if isinstance(error, _UNREADABLE):
            raise InputError(f"{file} is no backup of the arena, or not all of one ({error}); name another file") from error
        if isinstance(error, OSError):
            raise InputError(f"cannot restore into {folder}: {error.strerror or error}") from error
        raise


def _lay_out(tar: tarfile.TarFile, folder: Path, store: str) -> Copied:
    members = _Members(tar)
    manifest = json.loads(members.take(_MANIFEST))
    if manifest["format"] != _FORMAT:
        raise InputError(f"the backup is of format {manifest['format']}, by arena {manifest['arena']}; update this one")
    n_rows = None if manifest["store"] is None else fill(store, str(manifest["store"]), members.tables())
    n_files, folders = 0, []
    for info, content in members.files():
        path = folder / _path_of(info.name)
        if info.isdir():
            path.mkdir(mode=0o700)
            folders.append((path, info.mode))
            continue
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _OWNER)
        with os.fdopen(descriptor, "wb") as target:
            shutil.copyfileobj(content, target)
            os.fchmod(descriptor, info.mode & 0o777)
        os.utime(path, (info.mtime, info.mtime))
        n_files += 1
    for path, mode in reversed(folders):  # one that may not be written to is filled first
        path.chmod(mode & 0o777)
    return Copied(n_files=n_files, n_rows=n_rows)


class _Members:
    """The members of a backup, in their order; what is not of a backup raises `ValueError`."""

    def __init__(self, tar: tarfile.TarFile) -> None:
        self._tar = tar
        self._next = tar.next()

    def take(self, name: str) -> bytes:
        """Return the content of the next member, which must be called so."""
        if self._next is None or self._next.name != name:
            raise ValueError(f"it has no {name}")
        content = self._content(self._next).read()
        self._next = self._tar.next()
        return content

    def tables(self) -> Iterator[TableLines]:
        """Yield the tables of the store; each is read before the next."""
        while (info := self._next) is not None and info.name.startswith(_STORE):
            yield info.name.removeprefix(_STORE), self._content(info)
            self._next = self._tar.next()

    def files(self) -> Iterator[tuple[tarfile.TarInfo, IO[bytes]]]:
        """Yield the files and folders of the data folder."""
        while (info := self._next) is not None:
            yield info, BytesIO() if info.isdir() else self._content(info)
            self._next = self._tar.next()

    def _content(self, info: tarfile.TarInfo) -> IO[bytes]:
        content = self._tar.extractfile(info) if info.isreg() else None
        if content is None:
            raise ValueError(f"{info.name!r} is no file")
        return content


def _path_of(member: str) -> PurePosixPath:
    path = PurePosixPath(member.removeprefix(_DATA))
    if not member.startswith(_DATA) or path.is_absolute() or ".." in path.parts or not path.parts:
        raise ValueError(f"it has a member {member!r}")
    return path


def _empty(folder: Path, *, keep: bool) -> None:
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
    if not keep:
        folder.rmdir()
