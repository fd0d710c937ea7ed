"""What may stand behind an entry of a league: a policy's name, a file, a program, or a public key that plays from elsewhere."""

from hashlib import sha256
from pathlib import Path

from arena.errors import InputError
from arena.files import read_file
from arena.protocol.identity import from_text
from policies.program import PREFIX as PROGRAM

REMOTE = "key:"
"""Stands before the public key of an entry that joins by itself, from wherever it is."""
FILES = {".py": "bot file", ".safetensors": "checkpoint"}
"""By how a file's name ends."""


def kind_of_file(spec: str) -> str | None:
    """Return in words what kind of file a fighter is; None if it is no file."""
    return None if spec.startswith((PROGRAM, REMOTE)) else FILES.get(Path(spec).suffix)


def name_of(spec: str) -> str:
    """Return what an entry is called that was given no name: a file's without its ending, else all that is said of it."""
    return spec if kind_of_file(spec) is None else Path(spec).stem


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
