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


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """How bots of a language are written, built and run."""

    source: str
    source_with_memory: str
    bot: str
    """As `policies.registry.load` takes it, in the bot's folder."""
    bot_with_memory: str
    build: tuple[str, ...] = ()
    """Command lines."""
    needs: tuple[str, ...] = ()
    """Commands that build it and run it."""

    @property
    def folders(self) -> tuple[str, ...]:
        """The templates beside those of the language itself."""
        return ("common", "program") if self.bot.startswith(PROGRAM) else ("common",)


LANGUAGES = {
    "python": Language(
        source="bot.py", source_with_memory="bot_with_memory.py", bot="bot.py", bot_with_memory="bot_with_memory.py"
    ),
    "js": Language(
        source="bot.js",
        source_with_memory="bot_with_memory.js",
        bot="exec:node bot.js",
        bot_with_memory="exec:node bot_with_memory.js",
        needs=("node",),
    ),
    "c": Language(
        source="bot.c",
        source_with_memory="bot_with_memory.c",
        bot="exec:./bot",
        bot_with_memory="exec:./bot_with_memory",
        build=("cc -std=c11 -O2 -o bot bot.c", "cc -std=c11 -O2 -o bot_with_memory bot_with_memory.c"),
        needs=("cc",),
    ),
    "rust": Language(
        source="bot.rs",
        source_with_memory="bot_with_memory.rs",
        bot="exec:./bot",
        bot_with_memory="exec:./bot_with_memory",
        build=("rustc --edition 2021 -O -o bot bot.rs", "rustc --edition 2021 -O -o bot_with_memory bot_with_memory.rs"),
        needs=("rustc",),
    ),
    "java": Language(
        source="Bot.java",
        source_with_memory="BotWithMemory.java",
        bot="exec:java -jar bot.jar",
        bot_with_memory="exec:java -cp bot.jar BotWithMemory",
        build=("javac -d build *.java", "jar --create --file bot.jar --main-class Bot -C build ."),
        needs=("javac", "jar", "java"),
    ),
}


def write_bot(folder: Path, language: Language) -> list[str]:
    """Make a folder with the bots of a language, and return the names of its files.

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
            text = _fill(template.read_text(encoding="utf-8"), folder.name, language)
            (folder / names[-1]).write_text(text, encoding="utf-8")
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f"cannot write into {folder}: {error.strerror}; nothing is left of it") from error
    return sorted(names)


def _templates(language: Language) -> Iterator[Traversable]:
    room = files("tournaments.authoring") / "templates"
    own = next(name for name, known in LANGUAGES.items() if known is language)
    for name in (own, *language.folders):
        yield from (room / name).iterdir()


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
