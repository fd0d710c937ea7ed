"""What may stand behind an entry of a league: a policy's name, a file, a program, or a public key that plays from elsewhere."""

import re
import shlex
from hashlib import file_digest, sha256
from pathlib import Path

from arena.errors import InputError
from arena.files import read_file
from arena.protocol.identity import from_text
from policies import program
from policies.program import PREFIX as PROGRAM
from policies.registry import split_settings, without_settings

REMOTE = "key:"
"""Stands before the public key of an entry that joins by itself, from wherever it is."""
_HASHED = re.compile(r"(.*) ([0-9a-f]{64})", re.DOTALL)
FILES = {".py": "bot file", ".safetensors": "checkpoint"}
"""By how a file's name ends."""


def kind_of_file(spec: str) -> str | None:
    """Return in words what kind of file a fighter is; None if it is no file."""
    return None if spec.startswith((PROGRAM, REMOTE)) else FILES.get(Path(without_settings(spec)).suffix)


def name_of(spec: str) -> str:
    """Return what an entry without a name is called: a file or a script without its ending, else all that is said of it."""
    if spec.startswith(PROGRAM):
        name = program.name_of(spec.removeprefix(PROGRAM)) or spec
    else:
        file, settings = split_settings(spec)
        name = spec if kind_of_file(spec) is None else f"{Path(file).stem}{settings}"
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


def fingerprint_of(spec: str, command: str = "") -> str:
    """Return what tells one fighter from another: what it is called, and a hash of the files that are its code.

    Parameters
    ----------
    spec
        As a league holds it: files by their full path.
    command
        Of a program: its command line as it is written, which is the same wherever the files lie.
    """
    kind = kind_of_file(spec)
    try:
        if kind is not None:
            file, settings = split_settings(spec)
            return f"{Path(file).name}{settings} {sha256(read_file(Path(file)) + settings.encode()).hexdigest()}"
        content = b"".join(_hash_file(path) for path in _code_of_program(spec, command))
    except OSError as error:
        raise InputError(f"cannot read the {kind or 'file'} {error.filename or spec}: {error.strerror}") from error
    return f"{command or spec} {sha256(content).hexdigest()}" if content else command or spec


def is_same_code(one: str, other: str) -> bool:
    """Whether two fingerprints are of one code.

    A file may have another name. Of programs, older stores do not know the content of their files.
    """
    (what, content), (others_what, others_content) = _split(one), _split(other)
    if one.startswith(PROGRAM):
        return what == others_what and ("" in (content, others_content) or content == others_content)
    return one == other or ("" != content == others_content)


def _split(fingerprint: str) -> tuple[str, str]:
    """Return what a fighter is called, and the hash of its files; empty if it has none."""
    found = _HASHED.fullmatch(fingerprint)
    return (found[1], found[2]) if found else (fingerprint, "")


def _code_of_program(spec: str, command: str) -> list[Path]:
    """Return the files that a program's command line names, but for an interpreter of this machine."""
    try:
        words, written = (shlex.split(line.removeprefix(PROGRAM)) for line in (spec, command or spec))
    except ValueError:
        return []
    is_of_machine = not spec.startswith(PROGRAM) or (bool(written) and Path(written[0]).is_absolute())
    return [path for path in map(Path, words[is_of_machine:]) if path.is_absolute() and path.is_file()]


def _hash_file(path: Path) -> bytes:
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()
