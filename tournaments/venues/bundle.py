"""Entries as they are sent to another machine: names as they are, files with what is in them."""

import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from platformdirs import user_cache_path

from arena.errors import InputError
from arena.files import read_file
from tournaments.league.entries import kind_of_file


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """The fighters behind entries."""

    specs: Mapping[str, str]
    """By entry."""
    files: Mapping[str, bytes]
    """What is in those of them that are files, by their paths on the machine that sent them."""

    def unpack(self) -> dict[str, str]:
        """Return the fighters as this machine can load them, by entry.

        Files lie in the user's cache, under a hash of what is in them: who unpacks them again finds the same paths, and modules
        of bots are not loaded under ever new names.

        Raises
        ------
        InputError
            They cannot be written.
        """
        places = {spec: _place(spec, content) for spec, content in self.files.items()}
        return {name: places.get(spec, spec) for name, spec in self.specs.items()}


def pack(specs: Mapping[str, str]) -> Bundle:
    """Pack the fighters behind entries.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    files = {}
    for spec in set(specs.values()):
        kind = kind_of_file(spec)
        if kind is not None:
            try:
                files[spec] = read_file(Path(spec))
            except OSError as error:
                raise InputError(f"cannot read the {kind} {spec}: {error.strerror}") from error
    return Bundle(specs=dict(specs), files=files)


def _place(spec: str, content: bytes) -> str:
    folder = user_cache_path("arena") / "entries" / sha256(content).hexdigest()
    path = folder / Path(spec).name
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not path.is_file() or path.read_bytes() != content:
            descriptor, part = tempfile.mkstemp(dir=folder)  # others may unpack the same
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
            Path(part).replace(path)
    except OSError as error:
        raise InputError(f"cannot unpack {path.name} into {folder}: {error.strerror}") from error
    return str(path)
