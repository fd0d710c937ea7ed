"""A folder to begin a bot in: two bots that play, tests, a league, and what to do with them."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from arena.errors import InputError
from arena.protocol.topics import is_chunk
from policies.program import PREFIX as PROGRAM

_TEMPLATE = ".template"
"""Ends the names of templates in Python, which are no modules of ours."""


@dataclass(frozen=True, slots=True)
class Language:
    """How bots of a language are written, built and run."""

    source: str
    source_with_memory: str
    bot: str
    """As `policies.registry.load` takes it, in the bot's folder."""
    bot_with_memory: str
    build: tuple[str, ...] = ()
    """Command lines."""


LANGUAGES = {
    "python": Language("bot.py", "bot_with_memory.py", "bot.py", "bot_with_memory.py"),
    "js": Language("bot.js", "bot_with_memory.js", "exec:node bot.js", "exec:node bot_with_memory.js"),
    "c": Language(
        "bot.c", "bot_with_memory.c", "exec:./bot", "exec:./bot_with_memory",
        ("cc -std=c11 -O2 -o bot bot.c", "cc -std=c11 -O2 -o bot_with_memory bot_with_memory.c"),
    ),
    "rust": Language(
        "bot.rs", "bot_with_memory.rs", "exec:./bot", "exec:./bot_with_memory",
        ("rustc --edition 2021 -O -o bot bot.rs", "rustc --edition 2021 -O -o bot_with_memory bot_with_memory.rs"),
    ),
    "java": Language(
        "Bot.java", "BotWithMemory.java", "exec:java -jar bot.jar", "exec:java -cp bot.jar BotWithMemory",
        ("javac -d build *.java", "jar --create --file bot.jar --main-class Bot -C build ."),
    ),
}  # fmt: skip


def write_bot(folder: Path, language: str) -> list[str]:
    """Make a folder with the bots of one of the `LANGUAGES`, and return the names of its files.

    Raises
    ------
    InputError
        The folder's name is no name for an entry, something is there already, or it cannot be written; nothing is left of it.
    """
    if not is_chunk(folder.name):
        raise InputError(f"{folder.name or str(folder)!r} is no name for a bot; it must be 1 to 64 letters, digits, - or _")
    names = []
    try:
        folder.mkdir()
    except FileExistsError as error:
        raise InputError(f"{folder} is there already; nothing was written") from error
    except OSError as error:
        raise InputError(f"cannot make the folder {folder}: {error.strerror}") from error
    try:
        for template in _templates(language):
            names.append(template.name.removesuffix(_TEMPLATE))
            text = _fill(template.read_text(encoding="utf-8"), folder.name, LANGUAGES[language])
            (folder / names[-1]).write_text(text, encoding="utf-8")
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f"cannot write into {folder}: {error.strerror}; nothing is left of it") from error
    return sorted(names)


def _templates(language: str) -> Iterator[Traversable]:
    templates = files("tournaments.authoring") / "templates"
    is_program = LANGUAGES[language].bot.startswith(PROGRAM)
    for name in (language, "common", *(["program"] if is_program else [])):
        yield from (templates / name).iterdir()


def _fill(text: str, name: str, language: Language) -> str:
    """Put what is particular to a bot where a template has @WORDS@."""
    is_program = language.bot.startswith(PROGRAM)
    words = {
        "NAME": name,
        "SOURCE": language.source,
        "SOURCE_WITH_MEMORY": language.source_with_memory,
        "BOT": language.bot,
        "BOT_WITH_MEMORY": language.bot_with_memory,
        "COMMAND": language.bot.removeprefix(PROGRAM),
        "BUILD": "".join(f"    {line}\n" for line in language.build),
        "MAPS": "fresh" if is_program else "paired",
    }
    for word, value in words.items():
        text = text.replace(f"@{word}@", value)
    return text
