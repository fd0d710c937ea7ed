"""Entries as they are sent to another machine: names as they are, files and folders with what is in them."""

import os
import shlex
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from platformdirs import user_cache_path

from arena.errors import InputError
from arena.files import read_file
from policies.program import PREFIX as PROGRAM
from policies.registry import split_settings, without_settings
from policies.workers.files import resolve
from tournaments.league.entries import kind_of_file
from tournaments.venues.setting import Fighter

MOST_FILES = 2_000
MOST_BYTES = 1 << 28
"""Of one fighter."""
_OF_EVERY_MACHINE = [
    Path(path) for path in ("/usr", "/bin", "/sbin", "/lib", "/lib64", "/etc", "/opt", sys.prefix, sys.base_prefix)
]
"""What lies there is installed, and no part of a fighter: an interpreter, most likely."""


@dataclass(frozen=True, slots=True)
class _File:
    content: bytes
    is_executable: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Files:
    """The files and folders that one fighter names, as they lie to each other."""

    parent: Path
    """What all of them are in, on the machine that sent them."""
    named: tuple[Path, ...]
    """Those that the fighter names."""
    files: Mapping[str, _File]
    """By their paths from `parent`."""

    @property
    def digest(self) -> str:
        """A hash of all of it."""
        whole = sha256()
        for path, file in sorted(self.files.items()):
            whole.update(f"{len(path)} {path} {file.is_executable} {len(file.content)} ".encode(errors="surrogateescape"))
            whole.update(file.content)
        return whole.hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """The fighters behind entries."""

    specs: Mapping[str, str]
    """By entry."""
    files: Mapping[str, _Files]
    """What those of them name that are files or programs, by fighter."""

    def unpack(self) -> dict[str, str]:
        """Return the fighters as this machine can load them, by entry.

        Files lie in the user's cache, under a hash of what is in them: who unpacks them again finds the same paths, and modules
        of bots are not loaded under ever new names.

        Raises
        ------
        InputError
            They cannot be written.
        """
        places = {spec: _place(spec, files) for spec, files in self.files.items()}
        return {name: places.get(spec, spec) for name, spec in self.specs.items()}


def pack(specs: Mapping[str, str]) -> Bundle:
    """Pack the fighters behind entries: files, the folders of submissions, and the files and folders that programs name.

    What is installed on a machine, as an interpreter is, does not travel; nor do links.

    Raises
    ------
    InputError
        A file cannot be read, or there are too many, or they are too large.
    """
    files = {spec: found for spec in set(specs.values()) if (found := _pack(spec)) is not None}
    return Bundle(specs=dict(specs), files=files)


def freeze(fighters: Mapping[str, Fighter]) -> dict[str, Fighter]:
    """Return fighters such that what is edited while they play changes no file that plays behind a wall."""
    walled = {
        name: one.spec
        for name, one in fighters.items()
        if one.sandbox is not None and one.sandbox.has_wall and kind_of_file(one.spec) is not None
    }
    copies = pack(walled).unpack()
    return {name: replace(one, spec=copies.get(name, one.spec)) for name, one in fighters.items()}


def _pack(spec: str) -> _Files | None:
    kind = kind_of_file(spec)
    if kind is None and not spec.startswith(PROGRAM):
        return None
    found = resolve(spec)[1] or ([Path(without_settings(spec)).absolute()] if kind is not None else [])
    named = [path for path in found if kind is not None or not _is_of_every_machine(path)]
    roots = [path for path in named if not any(other in path.parents for other in named)]
    if not roots:
        return None
    parent = Path(os.path.commonpath([root.parent for root in roots]))
    files: dict[str, _File] = {}
    n_bytes = 0
    for root in roots:
        for path in _walk(root):
            try:
                content = read_file(path, MOST_BYTES)
            except OSError as error:
                raise InputError(f"cannot read the {kind or 'file'} {path}: {error.strerror}") from error
            files[str(path.relative_to(parent))] = _File(content, os.access(path, os.X_OK))
            n_bytes += len(content)
            if len(files) > MOST_FILES or n_bytes > MOST_BYTES:
                raise InputError(
                    f"{spec} names {root}, and what it names is sent to other machines: at most {MOST_FILES:,} files of "
                    f"{MOST_BYTES >> 20} MB together"
                )
    return _Files(parent=parent, named=tuple(named), files=files)


def _is_of_every_machine(path: Path) -> bool:
    return any(path.is_relative_to(folder) or folder.is_relative_to(path) for folder in _OF_EVERY_MACHINE)


def _walk(root: Path) -> Iterator[Path]:
    """Yield a file, or the files in a folder; a link in it leads elsewhere, and is left out."""
    if not root.is_dir():
        yield root
        return
    for folder, _, names in os.walk(root):
        yield from (path for name in sorted(names) if not (path := Path(folder, name)).is_symlink())


def _place(spec: str, packed: _Files) -> str:
    """Write what a fighter names, and return the fighter that names it there."""
    folder = user_cache_path("arena") / "entries" / packed.digest
    for path, file in packed.files.items():
        _write(folder / path, file)
    moved = {str(path): str(folder / path.relative_to(packed.parent)) for path in packed.named}
    if not spec.startswith(PROGRAM):
        named, settings = split_settings(spec)
        return f"{moved[str(Path(named).absolute())]}{settings}"
    words = shlex.split(spec.removeprefix(PROGRAM))
    return PROGRAM + shlex.join(moved.get(str(Path(word).absolute()), word) for word in words)


def _write(path: Path, file: _File) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not path.is_file() or path.read_bytes() != file.content or os.access(path, os.X_OK) != file.is_executable:
            descriptor, part = tempfile.mkstemp(dir=path.parent)  # others may unpack the same
            try:
                with os.fdopen(descriptor, "wb") as copy:
                    copy.write(file.content)
                Path(part).chmod(0o700 if file.is_executable else 0o600)
                Path(part).replace(path)
            except OSError:
                Path(part).unlink(missing_ok=True)
                raise
    except OSError as error:
        raise InputError(f"cannot unpack {path.name} into {path.parent}: {error.strerror}") from error
