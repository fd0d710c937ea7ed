"""The sub-command that takes a bot back to a tick of a match that was played: `arena debug`."""

from pathlib import Path
from typing import Annotated

import typer

from policies.cli import complete_policy


def debug(
    file: Annotated[Path, typer.Argument(metavar="TRANSCRIPT|JOURNAL", help="What is kept of the match.")],
    policy: Annotated[str, typer.Option(metavar="FILE.py|NAME", autocompletion=complete_policy, help="The bot, as it is now.")],
    tick: Annotated[
        int | None,
        typer.Option(help="Stop inside its act at this tick, in Python's debugger; of a planner, show what it thinks."),
    ] = None,
    team: Annotated[
        str | None, typer.Option(help="Whose seat of a journal: blue or red; the one that is named like the bot without it.")
    ] = None,
) -> None:
    """Give a bot exactly what it saw in a match, and stop inside its act at a tick; or tell where its orders first differ.

    The bot plays in this process, from tick 0 on, with the seeds of the match; what it orders changes nothing any more. With
    --tick, pdb stops at the first line of its act (n: next line, p NAME: print, c: go on, q: leave), or where it raises before.
    Without it, the first tick is told at which its orders differ from those that were played; then the exit code is 1.
    """
    from arena.compiling import compile_kernels, game_kernels
    from arena.display.team_option import read_team
    from policies.precompile import fighter_kernels
    from tournaments.authoring.check import find_bot
    from tournaments.authoring.debug import debug as debug_bot
    from tournaments.authoring.recorded_seat import open_seat
    from tournaments.league.entries import name_of

    spec = find_bot(policy)
    seat = open_seat(file, read_team(team, file), name_of(spec))
    compile_kernels([*game_kernels(seat.ruleset), *fighter_kernels([spec])])
    if debug_bot(seat, spec, tick):
        raise typer.Exit(1)
