"""The sub-commands of the referee: `arena serve`, and `arena replay`."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table
from arena.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from arena.games import Games
    from arena.records.journal import Journal

replay = typer.Typer(no_args_is_help=True, help="Look at journals, or check them.")


@replay.command("verify")
def verify_journals(
    files: Annotated[list[Path], typer.Argument(metavar="FILE|FOLDER...", help="Journals, or folders of them.")],
    transcript: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Check as well that this seat saw the match of the journal.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Play journals again and compare every tick, and check who signed them; exit 1 if one does not hold."""
    from arena.records.journal import find_journals

    paths = list(find_journals(files))
    if transcript is not None and len(paths) != 1:
        raise InputError(f"--transcript is of one match, and there are {len(paths)} journals; name the journal of that match")
    checks = [_check(path, transcript) for path in paths]
    broken = [check for check in checks if not check["ok"]]
    if as_json:
        print_json(checks[0] if len(checks) == 1 and not files[0].is_dir() else checks)
    elif len(checks) <= 20 or broken:
        shown = checks if len(checks) <= 20 else broken
        print_table(
            ("journal", "ok", "ticks", "signed", "canonical hash, or what is wrong"),
            [
                (check["file"], check["ok"], check["ticks"], _tell(check["seals"]), check.get("error") or check["canonical_hash"])
                for check in shown
            ],
        )
    if not as_json:
        typer.echo(f"{len(checks) - len(broken)} of {len(checks)} journals hold")
    if broken:
        raise typer.Exit(1)


def _check(path: Path, transcript: Path | None) -> dict[str, Any]:
    """Return what `--json` prints of one journal."""
    from arena.errors import JournalError
    from arena.records.journal import load_journal
    from arena.records.transcript import load_transcript
    from arena.referee.replay import BrokenChainError, verify
    from arena.referee.seals import check_seals, compare

    facts: dict[str, Any] = {"file": str(path), "ok": False, "ticks": 0, "canonical_hash": None, "seals": None}
    try:
        journal = load_journal(path)
        facts["canonical_hash"] = journal.canonical_hash
        checked = check_seals(journal)  # which plays a sealed journal again
        if checked is None:
            verify(journal)
        facts["ticks"] = len(journal.ticks)
        if checked is not None:
            receipts = {team.name.lower(): standing.value for team, standing in checked.receipts.items()}
            facts["seals"] = {"pit": checked.signature.value, "commitment": checked.commitment.value, "receipts": receipts}
            if not checked.is_sound:
                return facts | {"error": "it was signed by others than it says, or the pit broke its commitment"}
        difference = "" if transcript is None else compare(journal, load_transcript(transcript))
        return facts | ({"error": difference} if difference else {"ok": True})
    except BrokenChainError as error:
        return facts | {"ticks": error.tick, "error": str(error)}
    except JournalError as error:
        return facts | {"error": str(error)}


def _tell(seals: dict[str, Any] | None) -> str:
    """Return a cell on who signed."""
    if seals is None:
        return "by nobody: local"
    parts = {"pit": seals["pit"], **seals["receipts"]}
    bad = [f"{who} {standing}" for who, standing in parts.items() if standing != "holds"]
    return ", ".join(bad) if bad else "by pit, blue and red"


@replay.command("show")
def show_match(
    file: Annotated[Path, typer.Argument(help="A journal, or the transcript of a seat.")],
    team: Annotated[
        str | None, typer.Option(help="Whose view of a journal stands at the left: blue (without it) or red.")
    ] = None,
    tick: Annotated[int | None, typer.Option(help="Show this tick alone.")] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Ticks per second, on a terminal.")] = 8.0,
) -> None:
    """Play a match in the terminal: of a journal, a team's view at the left and the truth at the right.

    Of a transcript, what its seat saw, what it remembered and ordered, and at the end what befell it. Where stdout is no
    terminal, every tick is printed.
    """
    from rich.console import Console

    from arena.records.transcript import is_transcript

    if team not in (None, "blue", "red"):
        raise InputError(f"--team is {team!r}; it must be blue or red")
    console = Console()
    if not console.is_terminal:
        console.width = 10_000
    if is_transcript(file):
        if team is not None:
            raise InputError("--team is for journals; a transcript is what one seat saw")
        _show_transcript(console, file, tick, speed)
    else:
        _show_journal(console, file, team or "blue", tick, speed)


def _show_journal(console: "Console", file: Path, team: str, tick: int | None, speed: float) -> None:
    from arena.game.types import Team
    from arena.records.journal import load_journal
    from arena.referee.replay import replay as play_again

    journal = load_journal(file)
    frames = (_frame(journal, games, Team[team.upper()], console.width) for games in play_again(journal))
    _play(console, frames, len(journal.ticks), tick, speed)
    if journal.ending is not None and tick is None:
        winner = "a draw" if journal.ending.winner is None else f"{journal.ending.winner.name.lower()} wins"
        how = journal.ending.ending.name.lower().replace("_", " ")
        console.print(f"{winner} by {how} after {journal.ending.ticks} ticks, score {journal.ending.score} for blue")


def _show_transcript(console: "Console", file: Path, tick: int | None, speed: float) -> None:
    from rich.text import Text

    from arena.records.transcript import load_transcript
    from arena.view import Memory, tell_end, tell_losses, tell_orders, tell_result

    transcript = load_transcript(file)
    header, seen = transcript.header, list(transcript.observations())
    memory = Memory(header.ruleset.side)

    def draw(number: int) -> "RenderableType":
        now = seen[number]
        title = (
            f"pit {header.pit}, match {header.match}: {header.name} plays {header.team.name.lower()} against {header.opponent}\n"
            f"tick {number} of {header.ruleset.tick_limit}   score {now.score:+d}   units {now.living[0]}:{now.living[1]}"
            f"{'' if now.clock_s is None else f'   bank {now.clock_s:.1f} s'}\n"
            f"orders: {tell_orders(now, transcript.ticks[number][1])}"
        )
        return memory.draw_pair(_plain(title), now, console.width)

    _play(console, map(draw, range(len(seen))), len(seen) - 1, tick, speed)
    if tick is not None:
        return
    lines = list(tell_losses(seen))
    if transcript.ending is None:
        how = "stops" if transcript.is_whole else "was cut short"
        team = header.team.name.lower()
        lines += [f"the transcript {how} after {len(seen)} ticks, without an ending", f"unfinished as {team}"]
    else:
        result = transcript.ending
        lines += [tell_end(seen, result), tell_result(header.team, result)]
    for line in lines:
        console.print(Text(_plain(line)))


def _plain(text: str) -> str:
    """Return text of a stranger's making as a terminal may have it."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


def _play(console: "Console", frames: Iterator["RenderableType"], last: int, tick: int | None, speed: float) -> None:
    """Show the frame of one tick, or of each in its turn."""
    import time
    from itertools import islice

    from rich.live import Live

    if tick is not None:
        if not 0 <= tick <= last:
            there = f"ticks 0 to {last}" if last >= 0 else "no ticks"
            raise InputError(f"--tick is {tick}; the match has {there}")
        console.print(next(islice(frames, tick, None)))
    elif not console.is_terminal:
        for frame in frames:
            console.print(frame)
    else:
        with Live(console=console, auto_refresh=False, vertical_overflow="visible") as live:
            for frame in frames:
                live.update(frame, refresh=True)
                time.sleep(1 / speed)


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
    invite: Annotated[Path | None, typer.Option(metavar="FILE", help="Let in only who has one of its codes, one a line.")] = None,
    certificate: Annotated[
        tuple[Path, Path] | None, typer.Option(metavar="CERT KEY", help="For --listen tls/HOST:PORT: two PEM files.")
    ] = None,
) -> None:
    """Open a pit: a match begins when a red and a blue seat are taken. Unfinished matches are taken up again."""
    import signal

    from arena.access import Certificate
    from arena.address import Address
    from arena.folders import data_folder
    from arena.game.keys import new_secret, secret_from_seed
    from arena.game.ruleset import load, parse_overrides
    from arena.keyring.files import load_or_make, load_or_make_secret
    from arena.protocol.topics import check_chunk
    from arena.referee.match import Terms
    from arena.referee.register import Register, read_invites
    from arena.referee.serve import Pit, PitSettings

    if seed is not None:
        typer.echo("arena: warning: anyone can try small seeds; strangers should not be seated under --seed", err=True)
    folder = data_folder(data)
    identity = load_or_make(folder / "keys" / "pit.key")
    chosen = PitSettings(
        address=Address(endpoint=listen, pit=check_chunk("the pit's name", pit), fingerprint=identity.fingerprint),
        identity=identity,
        spectator_key=load_or_make_secret(folder / "keys" / "spectator.key"),
        register=Register(folder / "register.json", None if invite is None else read_invites(invite)),
        certificate=None if certificate is None else Certificate(certificate=certificate[0], key=certificate[1]),
        ruleset=load(rules).with_(parse_overrides(settings or [])),
        secret=new_secret() if seed is None else secret_from_seed(seed),
        terms=Terms(turn_time_s=turn_time, bank_s=bank, grace_s=grace, most_missed=missed),
        journals=folder / "journals",
        n_matches=matches,
        fsync=fsync,
    )
    server = Pit(chosen)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: server.stop())

    def on_open(n_resumed: int) -> None:
        typer.echo(f"pit open at {chosen.address} (rules {chosen.ruleset.name})")
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
