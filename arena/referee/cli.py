"""The sub-commands of the referee: `arena serve`, and `arena replay`."""

from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table
from arena.errors import InputError

_TURN_S, _HUMAN_TURN_S = 1.0, 30.0
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
    from arena.referee.show import show_journal, show_transcript
    from arena.view import is_live

    if team not in (None, "blue", "red"):
        raise InputError(f"--team is {team!r}; it must be blue or red")
    console = Console()
    if not is_live(console):
        console.width = 10_000
    if is_transcript(file):
        if team is not None:
            raise InputError("--team is for journals; a transcript is what one seat saw")
        show_transcript(console, file, tick, speed)
    else:
        show_journal(console, file, team or "blue", tick, speed)


@replay.command("export")
def export_match(
    file: Annotated[Path, typer.Argument(help="A journal, or the transcript of a seat.")],
    as_gif: Annotated[bool, typer.Option("--gif", help="Every tick, moving.")] = False,
    as_png: Annotated[bool, typer.Option("--png", help="One tick.")] = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Where to; here, named like the match, without it.")] = None,
    tick: Annotated[int | None, typer.Option(help="Which tick --png shows; the last without it.")] = None,
    team: Annotated[str | None, typer.Option(help="Whose view of a journal: blue (without it) or red.")] = None,
    cell: Annotated[int, typer.Option(min=6, max=64, metavar="PX", help="Width of a cell.")] = 16,
    speed: Annotated[float, typer.Option(min=0.1, max=50.0, help="Ticks per second, of --gif.")] = 4.0,
) -> None:
    """Draw a match as a picture for papers and talks: the two boards that `arena replay show` shows.

    Of a journal, a team's view at the left and the truth at the right, with the fights marked; of a transcript, what its seat saw
    and remembered.
    """
    from arena.console import progress_bar
    from arena.referee.export import count_ticks, draw, read_scenes, save_gif, save_png

    if as_gif == as_png:
        raise InputError("say either --gif, for every tick, or --png, for one")
    if as_gif and tick is not None:
        raise InputError("--tick is for --png; --gif shows every tick")
    if team not in (None, "blue", "red"):
        raise InputError(f"--team is {team!r}; it must be blue or red")
    last = count_ticks(file)
    if tick is not None and not 0 <= tick <= last:
        raise InputError(f"--tick is {tick}; the match has {f'ticks 0 to {last}' if last >= 0 else 'no ticks'}")
    chosen = last if tick is None else tick
    target = out or Path(file.with_suffix(".gif" if as_gif else ".png").name)
    scenes = read_scenes(file, team)
    if as_png:
        save_png(draw(next(islice(scenes, chosen, None)), cell), target)
    else:
        with progress_bar(last + 1, "drawing", each="ticks") as advance:
            images = []
            for scene in scenes:
                images.append(draw(scene, cell))
                advance(1)
        save_gif(images, target, speed)
    typer.echo(f"{target}: {'1 tick' if as_png else f'{last + 1} ticks'}, {target.stat().st_size / 1000:,.0f} kB")


def serve(
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = "tcp/127.0.0.1:7447",
    pit: Annotated[str, typer.Option(help="The pit's name.")] = "pit",
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a rule, as in side=16.")
    ] = None,
    matches: Annotated[int | None, typer.Option(min=1, help="End after so many; without it, go on until told to stop.")] = None,
    seed: Annotated[int | None, typer.Option(help="Makes the matches reproducible, and guessable by anyone.")] = None,
    turn_time: Annotated[
        float | None, typer.Option(min=0.001, metavar="SECONDS", help="For each turn; 1, or 30 with --humans.")
    ] = None,
    humans: Annotated[bool, typer.Option("--humans", help="People play here: turns last longer.")] = False,
    bank: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="Extra time of a seat for a whole match.")] = 10.0,
    grace: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="How long a seat that vanished keeps its place.")] = 10.0,
    missed: Annotated[int, typer.Option(min=1, help="Turns missed in a row that forfeit a match.")] = 10,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Where journals live; your data folder without it.")] = None,
    ladder: Annotated[
        bool, typer.Option("--ladder", help="Match whoever comes by rating and waiting time, and rate them.")
    ] = False,
    db: Annotated[
        str, typer.Option(metavar="URL|FILE", help="The store of a ladder; arena.db in the data folder without it.")
    ] = "",
    fsync: Annotated[bool, typer.Option("--fsync", help="Let every tick outlive a power cut, at its price.")] = False,
    invite: Annotated[Path | None, typer.Option(metavar="FILE", help="Let in only who has one of its codes, one a line.")] = None,
    certificate: Annotated[
        tuple[Path, Path] | None, typer.Option(metavar="CERT KEY", help="For --listen tls/HOST:PORT: two PEM files.")
    ] = None,
    web: Annotated[
        int | None, typer.Option(metavar="PORT", min=1, max=65535, help="Show the pit in the browser, on this machine.")
    ] = None,
    no_web: Annotated[bool, typer.Option("--no-web", help="Do not; so it is without --web.")] = False,
) -> None:
    """Open a pit: a match begins when a red and a blue seat are taken. Unfinished matches are taken up again.

    With --ladder, entries that wait are matched by the pit, on a map of their own, and rated; `arena leaderboard --ladder` tells.
    """
    import signal
    import sys
    from contextlib import ExitStack, nullcontext
    from dataclasses import replace

    from arena.access import Certificate
    from arena.address import Address
    from arena.folders import data_folder
    from arena.game.keys import new_secret, secret_from_seed
    from arena.game.ruleset import load, parse_overrides
    from arena.keyring.files import load_or_make, load_or_make_secret
    from arena.protocol.topics import check_chunk
    from arena.referee.ladder import find_ladder
    from arena.referee.match import Terms
    from arena.referee.register import Register, read_invites
    from arena.referee.serve import Pit, PitSettings
    from arena.referee.web import web_page

    if db and not ladder:
        raise InputError("--db is where a ladder is kept; give --ladder as well")
    if web is not None and no_web:
        raise InputError("--web and --no-web exclude each other")
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
        terms=Terms(
            turn_time_s=turn_time or (_HUMAN_TURN_S if humans else _TURN_S),
            bank_s=bank,
            grace_s=grace,
            most_missed=missed,
        ),
        journals=folder / "journals",
        n_matches=matches,
        fsync=fsync,
    )

    def on_open(n_resumed: int) -> None:
        typer.echo(f"pit open at {chosen.address} (rules {chosen.ruleset.name})")
        typer.echo(f"join with: arena join {chosen.address} --team any --policy rush{' --forever' if ladder else ''}")
        if n_resumed:
            typer.echo(f"{n_resumed} unfinished matches wait for their seats to come back")
        if web is not None:
            sys.stdout.flush()  # the page says its address on the same stdout
            beside.enter_context(web_page(chosen.address, web, folder, db, None if certificate is None else certificate[0]))

    opened = find_ladder()(db or str(folder / "arena.db"), pit, chosen.ruleset.hash) if ladder else nullcontext()
    with opened as kept, ExitStack() as beside:
        server = Pit(replace(chosen, ladder=kept))
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: server.stop())
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
