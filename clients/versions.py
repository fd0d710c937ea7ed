"""What an entry tells a ladder of its code: something that changes with it, and says nothing else."""

import shlex
from collections.abc import Iterator
from hashlib import file_digest, sha256
from importlib.metadata import version as version_of_package
from pathlib import Path
from stat import S_ISREG

from arena.errors import InputError
from arena.files import mode_of
from policies.program import PREFIX
from policies.registry import split_settings

_LENGTH = 32
"""Hexadecimal digits."""


def find_version(spec: str, entry: bytes) -> str:
    """Return what tells the code of a fighter from its other versions, as a chunk.

    It is a hash of the content of the bot's file, or of a program's command line and the files that it names, and of the entry's
    key: nobody can tell from it what plays, or whether two entries play the same. Of our own fighters, and of installed ones, the
    name and the version of this package stand for the code.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    digest = sha256(entry)
    fighter, settings = split_settings(spec)
    files = list(_hash_files(fighter))
    if spec.startswith(PREFIX) or not files:
        digest.update(sha256(spec.encode()).digest())
    elif settings:
        digest.update(sha256(settings.encode()).digest())
    for part in files or [version_of_package("arena-pit").encode()]:
        digest.update(part)
    return digest.hexdigest()[:_LENGTH]


def _hash_files(spec: str) -> Iterator[bytes]:
    try:
        words = shlex.split(spec.removeprefix(PREFIX)) if spec.startswith(PREFIX) else [spec]
    except ValueError:  # whoever starts the program says so
        return
    if spec.startswith(PREFIX) and words and Path(words[0]).is_absolute():
        words = words[1:]  # an interpreter of this machine
    for path in map(Path, words):
        if S_ISREG(mode_of(path)):
            try:
                with path.open("rb") as file:
                    yield file_digest(file, "sha256").digest()
            except OSError as error:
                raise InputError(f"cannot read {path}: {error.strerror}") from error
