"""Read a bot from a file of its author's: a function `act(observation)`, or a class with a method `act`."""

import importlib.util
import os
import sys
import traceback
from hashlib import sha256
from pathlib import Path
from types import ModuleType

from arena.errors import PolicyError
from arena.files import MOST_TEXT_BYTES, read_file
from policies.each_seat import MakeBot, WithoutMemory

NO_BOT = "has no bot; write a function act(observation), or a class with a method act(self, observation)"
_CLASS_NAMES = ("Policy", "Bot")


def load_bot(file: str) -> MakeBot:
    """Return what makes the bot of a Python file.

    A function `act` comes first, then a class named `Policy` or `Bot`, then the only class that defines `act`.

    Raises
    ------
    PolicyError
        The file cannot be read or imported, or has no bot, or several.
    """
    module = _import(Path(file))
    act = getattr(module, "act", None)
    if callable(act) and not isinstance(act, type):
        bot = WithoutMemory(act)
        return lambda: bot
    fighters = {
        name: kind
        for name, kind in vars(module).items()
        if isinstance(kind, type) and kind.__module__ == module.__name__ and callable(getattr(kind, "act", None))
    }
    for name in _CLASS_NAMES:
        if name in fighters:
            return fighters[name]
    if len(fighters) > 1:
        raise PolicyError(f"{file} has several bots, {' and '.join(sorted(fighters))}; name the one to play Policy")
    for fighter in fighters.values():
        return fighter
    raise PolicyError(f"{file} {NO_BOT}")


def _import(path: Path) -> ModuleType:
    """Run the file as a module; its folder comes last on the path, so that it cannot replace what others import."""
    try:
        source = read_file(path, MOST_TEXT_BYTES * 16)
    except OSError as error:
        raise PolicyError(f"cannot read the bot file {path}: {error.strerror}") from error
    place = path.resolve()
    try:
        code = compile(source, str(place), "exec")
    except SyntaxError as error:
        raise PolicyError(f"{path}, line {error.lineno or 1}: this is not Python: {error.msg}") from error
    except ValueError as error:
        raise PolicyError(f"{path} is not Python: {error}") from error
    if str(place.parent) not in sys.path:
        sys.path.append(str(place.parent))
    name = f"bot_{place.stem}_{sha256(os.fsencode(place)).hexdigest()[:8]}"  # two bots may share a file name
    module = ModuleType(name)
    module.__file__ = str(place)
    module.__spec__ = importlib.util.spec_from_file_location(name, place)
    sys.modules[name] = module
    try:
        exec(code, module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        del sys.modules[name]
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(place)]
        where = f"{path}, line {lines[-1]}" if lines else str(path)
        what = " ".join(traceback.format_exception_only(error)[-1].split())
        raise PolicyError(f"{where}: the bot cannot be imported: {what}") from error
    return module
