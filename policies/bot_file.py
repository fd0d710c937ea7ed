"""Read a bot from a file of its author's: a function `act(observation)`, a class with a method `act`, or a `BatchPolicy`."""

import importlib.util
import os
import sys
import traceback
from collections.abc import Callable
from hashlib import sha256
from inspect import isabstract
from pathlib import Path
from types import ModuleType
from typing import Any

from arena.errors import PolicyError
from arena.files import MOST_TEXT_BYTES, read_file
from arena.policy import BatchPolicy
from policies.each_seat import WithoutMemory

NO_BOT = "has no bot; write a function act(observation), or a class with a method act(self, observation)"
_CLASS_NAMES = ("Policy", "Bot")


def load_bot(file: str) -> Callable[..., Any]:
    """Return what makes the bot of a Python file, or the `BatchPolicy` that it has instead.

    A function `act` comes first, then a class named `Policy` or `Bot`, then the only class that defines `act`.

    Raises
    ------
    PolicyError
        The file cannot be read or imported, or has no bot, or several, or a `BatchPolicy` that asks to see the whole board, or
        for no number of seats.
    """
    module = _import(Path(file))
    act = getattr(module, "act", None)
    if callable(act) and not isinstance(act, type):
        bot = WithoutMemory(act)
        return lambda: bot
    fighters = {
        name: kind
        for name, kind in vars(module).items()
        if isinstance(kind, type)
        and kind.__module__ == module.__name__
        and callable(getattr(kind, "act", None))
        and not isabstract(kind)
    }
    named = [name for name in _CLASS_NAMES if name in fighters] or list(fighters)
    if not named:
        raise PolicyError(f"{file} {NO_BOT}")
    if len(named) > 1 and named[0] not in _CLASS_NAMES:
        raise PolicyError(f"{file} has several bots, {' and '.join(sorted(fighters))}; name the one to play Policy")
    fighter = fighters[named[0]]
    if (batch := batch_policy(fighter)) is not None:
        if batch.is_cheat:
            raise PolicyError(f"{file}: {named[0]} sets is_cheat, which no bot file may; leave it out")
        most_seats = getattr(batch, "most_seats", 1)
        if not isinstance(most_seats, int) or most_seats < 1:
            raise PolicyError(f"{file}: {named[0]} sets most_seats to {most_seats!r}; it must be a whole number from 1 on")
    return fighter


def batch_policy(fighter: Callable[..., Any]) -> type[BatchPolicy] | None:
    """Return what `load_bot` returned if it is a `BatchPolicy`, else None."""
    return fighter if isinstance(fighter, type) and issubclass(fighter, BatchPolicy) else None


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
    except (RecursionError, MemoryError) as error:
        raise PolicyError(f"{path} cannot be compiled: an expression in it is too long, or nested too deeply") from error
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
