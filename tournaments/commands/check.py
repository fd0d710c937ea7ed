"""The sub-command that tells what would go wrong for a bot in a league: `arena check`."""

import sys
from typing import Annotated

import typer

from arena.console import AsJson, complete_ruleset, print_json, progress_bar, say
from arena.match.time_control import MOST_S
from policies.cli import complete_policy


def check(
    bot: Annotated[
        str, typer.Argument(metavar="BOT", autocompletion=complete_policy, help="A bot file, its folder, or exec:COMMAND.")
    ],
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    turn_time: Annotated[float, typer.Option(min=0.01, max=MOST_S, metavar="SECONDS", help="For each turn, as in a pit.")] = 1.0,
    bank: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="Extra time for a whole match.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """Play a bot under a pit's limits, and tell what would go wrong in a league.

    It plays shipped fighters on both sides, behind a wall where this machine can build one. Exits with 1 if a league would refuse
    the bot, or forfeit its matches; warnings cost nothing.
    """
    from arena.compiling import compile_kernels, game_kernels
    from arena.game.ruleset import load
    from arena.match.time_control import TimeControl
    from policies.precompile import fighter_kernels
    from tournaments.authoring.check import OPPONENTS, count_matches, find_bot
    from tournaments.authoring.check import check as check_bot

    spec, ruleset = find_bot(bot), load(rules)
    compile_kernels([*game_kernels(ruleset), *fighter_kernels([spec, *OPPONENTS])])
    with progress_bar(count_matches(), f"checking {bot}") as advance:
        report = check_bot(spec, ruleset, time_control=TimeControl(turn_time_s=turn_time, bank_s=bank), advance=advance)
    if as_json:
        print_json(report.to_dict())
    else:
        say(*report.describe())
    if not report.is_accepted:
        sys.exit(1)
