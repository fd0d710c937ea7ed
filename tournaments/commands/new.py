"""The sub-command that begins a bot: `arena new`."""

from pathlib import Path
from typing import Annotated

import typer

from arena.console import say
from arena.errors import UnknownNameError


def new(
    folder: Annotated[Path, typer.Argument(metavar="NAME", help="The bot's name, and the folder to make.")],
    language: Annotated[str, typer.Option(metavar="python|js|c|rust|java", help="What to write it in.")] = "python",
) -> None:
    """Make a folder with a bot that plays, one that remembers, their tests, a league, and a README with the commands."""
    from arena.compiling import compile_kernels, game_kernels
    from arena.game.ruleset import load
    from policies.precompile import fighter_kernels
    from tournaments.authoring.check import OPPONENTS
    from tournaments.authoring.new import LANGUAGES, write_bot

    if language not in LANGUAGES:
        raise UnknownNameError("language", language, LANGUAGES)
    chosen = LANGUAGES[language]
    say(f"wrote {folder}: {', '.join(write_bot(folder, language))}; next:")
    commands = [f"cd {folder}", *chosen.build, f"arena check {_quote(chosen.bot)}", "arena tournament run league.toml"]
    say(*(f"    {command}" for command in commands))
    compile_kernels([*game_kernels(load("paper")), *fighter_kernels(OPPONENTS)])


def _quote(bot: str) -> str:
    return f'"{bot}"' if " " in bot else bot
