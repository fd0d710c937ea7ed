"""What may stand behind an entry of a league: a policy's name, a file, a program, or a public key that plays from elsewhere."""

import shlex
from hashlib import sha256
from pathlib import Path

from arena.errors import InputError
from arena.files import read_file
from arena.protocol.identity import from_text
from policies import program
from policies.program import PREFIX as PROGRAM

REMOTE = "key:"
"""Stands before the public key of an entry that joins by itself, from wherever it is."""
FILES = {".py": "bot file", ".safetensors": "checkpoint"}
"""By how a file's name ends."""


def kind_of_file(spec: str) -> str | None:
    """Return in words what kind of file a fighter is; None if it is no file."""
    return None if spec.startswith((PROGRAM, REMOTE)) else FILES.get(Path(spec).suffix)


def name_of(spec: str) -> str:
    """Return what an entry without a name is called: a file or a script without its ending, else all that is said of it."""
    if spec.startswith(PROGRAM):
        name = program.name_of(spec.removeprefix(PROGRAM)) or spec
    else:
        name = spec if kind_of_file(spec) is None else Path(spec).stem
    return name.encode("utf-8", "replace").decode()  # a file's name may be no text


def find_program(spec: str, folder: Path) -> str:
    """Return a program such that it is found from anywhere: relative paths of files in its command line begin at `folder`."""
    try:
        words = shlex.split(spec.removeprefix(PROGRAM))
    except ValueError:
        return spec  # whoever loads it says so
    found = list(words)
    for number, word in enumerate(words):
        path = (folder / word).absolute()
        if not Path(word).is_absolute() and ("/" in word if number == 0 else path.is_file()):
            found[number] = str(path)
    return spec if found == words else PROGRAM + shlex.join(found)


def public_key_of(spec: str) -> bytes | None:
    """Return the key of an entry that joins by itself; None for one that the scheduler starts.

    Raises
    ------
    InputError
        What stands after `key:` is no public key.
    """
    return from_text(spec.removeprefix(REMOTE)) if spec.startswith(REMOTE) else None


def fingerprint_of(spec: str) -> str:
    """Return what tells one fighter from another: a file's name and content, else all that is said of it."""
    kind = kind_of_file(spec)
    if kind is None:
        return spec
    path = Path(spec)
    try:
        return f"{path.name} {sha256(read_file(path)).hexdigest()}"
    except OSError as error:
        raise InputError(f"cannot read the {kind} {spec}: {error.strerror}") from error
