"""The sub-command of journals: `arena replay`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, print_json, print_table
from arena.errors import InputError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from arena.games import Games
    from arena.referee.journal import Journal

replay = typer.Typer(no_args_is_help=True, help="Look at journals, or check them.")


@replay.command("verify")
def verify_journals(
    files: Annotated[list[Path], typer.Argument(metavar="FILE|FOLDER...", help="Journals, or folders of them.")],
    as_json: AsJson = False,
) -> None:
    """Play journals again and compare every tick; exit 1 if one does not hold."""
    from arena.referee.journal import find_journals

    checks = [_check(path) for path in find_journals(files)]
    broken = [check for check in checks if not check["ok"]]
    if as_json:
        print_json(checks[0] if len(checks) == 1 and not files[0].is_dir() else checks)
    elif len(checks) <= 20 or broken:
        shown = checks if len(checks) <= 20 else broken
        print_table(
            ("journal", "ok", "ticks", "canonical hash, or what is wrong"),
            [(check["file"], check["ok"], check["ticks"], check.get("error") or check["canonical_hash"]) for check in shown],
        )
    if not as_json:
        typer.echo(f"{len(checks) - len(broken)} of {len(checks)} journals hold")
    if broken:
        raise typer.Exit(1)


def _check(path: Path) -> dict[str, Any]:
    """Return what `--json` prints of one journal."""
    from arena.errors import JournalError
    from arena.referee.journal import load_journal
    from arena.referee.replay import BrokenChainError, verify

    facts: dict[str, Any] = {"file": str(path), "ok": False, "ticks": 0, "canonical_hash": None}
    try:
        journal = load_journal(path)
        facts["canonical_hash"] = journal.canonical_hash
        return facts | {"ticks": verify(journal), "ok": True}
    except BrokenChainError as error:
        return facts | {"ticks": error.tick, "error": str(error)}
    except JournalError as error:
        return facts | {"error": str(error)}


@replay.command("show")
def show_journal(
    file: Annotated[Path, typer.Argument(help="A journal.")],
    team: Annotated[str, typer.Option(help="Whose view stands at the left: blue or red.")] = "blue",
    tick: Annotated[int | None, typer.Option(help="Show this tick alone.")] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Ticks per second, on a terminal.")] = 8.0,
) -> None:
    """Play a match in the terminal: a team's view at the left, the truth at the right.

    Where stdout is no terminal, every tick is printed.
    """
    import time

    from rich.console import Console
    from rich.live import Live

    from arena.game.types import Team
    from arena.referee.journal import load_journal
    from arena.referee.replay import replay as play_again

    if team not in ("blue", "red"):
        raise InputError(f"--team is {team!r}; it must be blue or red")
    journal = load_journal(file)
    console = Console()
    if not console.is_terminal:
        console.width = 10_000
    n_ticks = len(journal.ticks)
    if tick is not None and not 0 <= tick <= n_ticks:
        raise InputError(f"--tick is {tick}; the match has ticks 0 to {n_ticks}")

    def frame(games: "Games") -> "RenderableType":
        return _frame(journal, games, Team[team.upper()], console.width)

    if tick is not None:
        for number, games in enumerate(play_again(journal)):
            if number == tick:
                console.print(frame(games))
                return
    if not console.is_terminal:
        for games in play_again(journal):
            console.print(frame(games))
    else:
        with Live(console=console, auto_refresh=False, vertical_overflow="visible") as live:
            for games in play_again(journal):
                live.update(frame(games), refresh=True)
                time.sleep(1 / speed)
    if journal.ending is not None:
        winner = "a draw" if journal.ending.winner is None else f"{journal.ending.winner.name.lower()} wins"
        how = journal.ending.ending.name.lower().replace("_", " ")
        console.print(f"{winner} by {how} after {journal.ending.ticks} ticks, score {journal.ending.score} for blue")


def _frame(journal: "Journal", games: "Games", team: Any, width: int) -> "RenderableType":
    from arena.game.state import Fact
    from arena.view import draw_pair

    fact = games.state.fact[0]
    header = journal.header
    title = (
        f"blue {header.blue} against red {header.red}   tick {fact[Fact.TICK]} of {header.ruleset.tick_limit}   "
        f"score {fact[Fact.SCORE]:+d}   units {fact[Fact.BLUE_LIVING]}:{fact[Fact.RED_LIVING]}"
    )
    return draw_pair(title, (f"what {team.name.lower()} sees", games.grids()[team, 0]), ("the truth", games.truth(0)), width)
