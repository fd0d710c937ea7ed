"""The sub-commands of the referee: `arena serve`, and `arena replay`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table
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


def serve(
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = "tcp/127.0.0.1:7447",
    pit: Annotated[str, typer.Option(help="The pit's name.")] = "pit",
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a rule, as in side=16.")
    ] = None,
    matches: Annotated[int | None, typer.Option(min=1, help="End after so many; without it, go on until told to stop.")] = None,
    seed: Annotated[int | None, typer.Option(help="Makes the matches reproducible, and guessable by anyone.")] = None,
    turn_time: Annotated[float, typer.Option(min=0.001, metavar="SECONDS", help="For each turn.")] = 1.0,
    bank: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="Extra time of a seat for a whole match.")] = 10.0,
    grace: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="How long a seat that vanished keeps its place.")] = 10.0,
    missed: Annotated[int, typer.Option(min=1, help="Turns missed in a row that forfeit a match.")] = 10,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Where journals live; your data folder without it.")] = None,
    fsync: Annotated[bool, typer.Option("--fsync", help="Let every tick outlive a power cut, at its price.")] = False,
) -> None:
    """Open a pit: a match begins when a red and a blue seat are taken. Unfinished matches are taken up again."""
    import signal

    from arena.address import Address
    from arena.folders import data_folder
    from arena.game.keys import new_secret, secret_from_seed
    from arena.game.ruleset import load, parse_overrides
    from arena.protocol.topics import check_chunk
    from arena.referee.match import Terms
    from arena.referee.serve import Pit, PitSettings

    if seed is not None:
        typer.echo("arena: warning: anyone can try small seeds; strangers should not be seated under --seed", err=True)
    chosen = PitSettings(
        listen=listen,
        address=Address(endpoint=listen, pit=check_chunk("the pit's name", pit)),
        ruleset=load(rules).with_(parse_overrides(settings or [])),
        secret=new_secret() if seed is None else secret_from_seed(seed),
        terms=Terms(turn_time_s=turn_time, bank_s=bank, grace_s=grace, most_missed=missed),
        journals=data_folder(data) / "journals",
        n_matches=matches,
        fsync=fsync,
    )
    server = Pit(chosen)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: server.stop())

    def on_open(n_resumed: int) -> None:
        typer.echo(f"pit open at {chosen.address}, rules {chosen.ruleset.name}")
        typer.echo(f"join with: arena join {chosen.address} --team any --policy rush")
        if n_resumed:
            typer.echo(f"{n_resumed} unfinished matches wait for their seats to come back")

    n_left = server.run(on_open, lambda played: typer.echo(_describe(played)))
    if n_left:
        typer.echo(f"{n_left} matches are unfinished; arena serve with the same --data takes them up again")


def _describe(played: Any) -> str:
    """Return a line on how a match ended, with what was counted."""
    header, result = played.header, played.result
    winner = "draw" if result.winner is None else f"{result.winner.name.lower()} wins"
    why = f" ({result.reason})" if result.reason else ""
    how = result.ending.name.lower().replace("_", " ")
    counted = [f"{team.name.lower()} {n} {what}" for team, seat in played.seats.items() for what, n in seat.faults().items() if n]
    return (
        f"{header.identity}: blue {header.blue}, red {header.red}: {winner} by {how}{why} "
        f"after {result.ticks} ticks, score {result.score:+d} for blue{'; counted: ' + ', '.join(counted) if counted else ''}"
    )
