"""The files that a fighter's name names: found from any folder, and shown to it behind its wall.

Of a submission, which its owner chose as a whole, that is its folder.
"""

import shlex
from collections.abc import Iterable
from pathlib import Path

from platformdirs import user_data_path

from arena.errors import InputError
from arena.files import mode_of
from arena.keyring.ring import config_folder
from arena.submission import MARK, START
from arena.submission import PROGRAM as SUBMITTED_PROGRAM
from policies.program import PREFIX as PROGRAM
from policies.registry import is_file_or_program, split_settings


def resolve(spec: str) -> tuple[str, list[Path]]:
    """Return a fighter such that it is found from any folder, and the files that it names."""
    if not spec.startswith(PROGRAM):
        file, settings = split_settings(spec)
        path = Path(file).absolute()
        if not (is_file_or_program(spec) and mode_of(path)):
            return spec, []
        return f"{path}{settings}", [path, path.parent] if mode_of(path.parent / MARK) else [path]
    try:
        words = shlex.split(spec.removeprefix(PROGRAM))
    except ValueError:
        return spec, []  # whoever loads it says so
    files = []
    for number, word in enumerate(words):
        path = Path(word).absolute()
        if mode_of(path) and (word.startswith("/") or path.is_file()) and (number > 0 or "/" in word):
            words[number] = str(path)
            files.append(path)
    return PROGRAM + shlex.join(words), files


def fighter_in(folder: Path) -> str:
    """Return the fighter in a folder that a submission was written to, as `policies.registry.load` takes it.

    A program is started by a script, since whatever its own command line named would be shown to it, wherever on this machine.
    """
    kind, main = (folder / MARK).read_text().splitlines()
    if kind != SUBMITTED_PROGRAM:
        return str(folder.absolute() / main)
    return PROGRAM + shlex.join(["sh", str(folder.absolute() / START), str(folder.absolute())])


def check_readable(spec: str, files: Iterable[Path]) -> None:
    """Refuse to show a stranger a folder that a wall is there to hide."""
    hidden = [Path.home(), user_data_path("arena"), config_folder(), Path("/proc"), Path("/sys"), Path("/dev")]
    for path in files:
        if any(folder.resolve().is_relative_to(path.resolve()) for folder in hidden):
            raise InputError(
                f"{spec} names {path}, and behind its wall it would see all that is in there; name a folder of its own"
            )
