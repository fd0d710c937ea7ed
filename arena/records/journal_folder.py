"""Where the journal of a match is: in a file of its own, or in a bundle of its folder. Whoever wants one asks here.

A journal in a bundle has a path as if it were a file, in the bundle's folder or in the bundle itself:

    kept/play+rush+patrol+0000+rush-blue+0.journal
    kept/000001.journals/play+rush+patrol+0000+rush-blue+0.journal

Of several with one identity, a file counts before bundles, and a later bundle before those that it follows.
"""

import errno
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from threading import Lock

from arena.errors import InputError, JournalError
from arena.files import MOST_BYTES, read_file
from arena.records.framing import load
from arena.records.journal import SUFFIX, Journal, identity_of, journal_name, read_journal
from arena.records.journal_bundle import SUFFIX as BUNDLE_SUFFIX
from arena.records.journal_bundle import Bundle

_IS_NO_FILE = (errno.ENOENT, errno.ENOTDIR, errno.ENAMETOOLONG)
_BUNDLES = f"*{BUNDLE_SUFFIX}"
_FOLDERS_KNOWN = 16
_SAME_MOMENT_NS = 100_000_000
"""A file system does not tell two changes apart that come sooner after each other."""


class JournalFolder:
    """The journals of a folder, however many come while it is asked; from any thread.

    A journal that cannot be read raises as `arena.files.read_file` does. A bundle that cannot, is none or has a newer format is
    a `JournalError` whatever is asked: nobody knows whose journals are in it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._bundles: dict[str, Bundle] = {}
        """By name, the last first."""
        self._changed_ns: int | None = None
        """When the folder had changed last as it was looked at; None if it may have changed again at that very moment."""
        self._looking = Lock()

    def read(self, identity: str, most_bytes: int = MOST_BYTES) -> bytes:
        """Return the journal of a match; `FileNotFoundError` if there is none."""
        try:
            return read_file(self.folder / journal_name(identity), most_bytes)
        except OSError as error:
            if error.errno not in _IS_NO_FILE:
                raise
        bundle = next((bundle for bundle in self._look() if identity in bundle), None)
        if bundle is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        return bundle.read(identity, most_bytes)

    def read_in(self, bundle: str, identity: str) -> bytes:
        """Return a journal from the bundle of this name; raises as `read`."""
        for one in self._look():
            if one.path.name == bundle and identity in one:
                return one.read(identity)
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))

    def holds(self, identity: str) -> bool:
        """Whether there is a journal of a match, or something of its name."""
        is_file = os.path.lexists(self.folder / journal_name(identity))
        return is_file or any(identity in bundle for bundle in self._look())

    def identities(self) -> set[str]:
        """Return the matches that have a journal."""
        return {*self._in_files(), *self.bundled()}

    def bundled(self) -> set[str]:
        """Return the matches whose journal is in a bundle, and in no file of its own."""
        return set[str]().union(*self._look()) - self._in_files()

    def _in_files(self) -> set[str]:
        return {identity_of(path.name) for path in self.folder.glob(f"*{SUFFIX}")}

    def _look(self) -> list[Bundle]:
        """Return the bundles that are there by now, the last first, with all that is in them."""
        with self._looking:
            with suppress(OSError):
                changed_ns = self.folder.stat().st_mtime_ns
                if changed_ns != self._changed_ns:
                    names = sorted((path.name for path in self.folder.glob(_BUNDLES) if is_bundle(path)), reverse=True)
                    self._bundles = {name: self._bundles.get(name) or Bundle(self.folder / name) for name in names}
                    self._changed_ns = changed_ns if time.time_ns() - changed_ns > _SAME_MOMENT_NS else None
            for bundle in self._bundles.values():
                _look_into(bundle)
            return list(self._bundles.values())


def has_journals(folder: Path) -> bool:
    """Whether a folder holds any journal."""
    return any(folder.glob(f"*{SUFFIX}")) or any(map(is_bundle, folder.glob(_BUNDLES)))


def is_bundle(path: Path) -> bool:
    """Whether a path leads to a bundle; a folder may be called so, too."""
    return path.suffix == BUNDLE_SUFFIX and path.is_file()


@lru_cache(maxsize=_FOLDERS_KNOWN)
def _folder(folder: Path) -> JournalFolder:
    """Return what is known of a folder, so that many of its journals are read one after the other."""
    return JournalFolder(folder)


def read_recorded(path: Path) -> bytes:
    """Return the bytes of a journal or a transcript, by its path; raises as `JournalFolder` does."""
    try:
        return read_file(path)
    except OSError as error:
        if error.errno not in _IS_NO_FILE or path.suffix != SUFFIX:
            raise
    identity, place = identity_of(path.name), path.parent.absolute()
    if is_bundle(place):
        return _folder(place.parent).read_in(place.name, identity)
    return _folder(place).read(identity)


def load_journal(path: Path) -> Journal:
    """Read a journal by its path; `JournalError` names it."""
    return load(path, read_journal, read_recorded)


def find_journals(paths: Iterable[Path]) -> Iterator[Path]:
    """Yield journals by their paths: each as it is, and those in each folder or bundle, by name.

    Raises
    ------
    InputError
        There is no such file, folder or journal in a bundle.
    """
    for path in paths:
        is_there, found = os.path.lexists(path), [path]
        if not is_there and not _is_bundled(path):
            raise InputError(f"cannot read {path}: {os.strerror(errno.ENOENT)}")
        if is_there and path.is_dir():
            found = sorted({*path.rglob(f"*{SUFFIX}"), *_in_bundles(path)})
        elif is_there and is_bundle(path):
            found = sorted(path / name for name in _names_in(path))
        if not found:
            raise InputError(f"{path} holds no journals (files ending in {SUFFIX}, and bundles ending in {BUNDLE_SUFFIX})")
        yield from found


def _in_bundles(folder: Path) -> Iterator[Path]:
    for path in folder.rglob(_BUNDLES):
        if is_bundle(path):
            yield from (path.parent / name for name in _names_in(path))


def _names_in(path: Path) -> Iterator[str]:
    bundle = Bundle(path)
    _look_into(bundle)
    return map(journal_name, bundle)


def _look_into(bundle: Bundle) -> None:
    try:
        bundle.look()
    except OSError as error:
        raise JournalError(f"cannot read the bundle {bundle.path}: {error.strerror}") from error


def _is_bundled(path: Path) -> bool:
    try:
        read_recorded(path)
    except OSError:
        return False
    return True
