"""The sub-commands of journals and transcripts: `arena replay`."""

from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

from arena.console import AsJson, print_json, print_table
from arena.errors import InputError

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
                (
                    check["file"],
                    check["ok"],
                    check["ticks"],
                    _format_signatures(check["seals"]),
                    check.get("error") or check["canonical_hash"],
                )
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
    from arena.records.replay import BrokenChainError, verify
    from arena.records.transcript import load_transcript
    from arena.records.verification import check_seals, compare

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


def _format_signatures(seals: dict[str, Any] | None) -> str:
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

    from arena.display.terminal_replay import show_journal, show_transcript
    from arena.display.text import is_live
    from arena.records.transcript import is_transcript

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
    from arena.display.image import count_ticks, draw, read_frames, save_gif, save_png

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
    frames = read_frames(file, team)
    if as_png:
        save_png(draw(next(islice(frames, chosen, None)), cell), target)
    else:
        with progress_bar(last + 1, "drawing", each="ticks") as advance:
            images = []
            for frame in frames:
                images.append(draw(frame, cell))
                advance(1)
        save_gif(images, target, speed)
    typer.echo(f"{target}: {'1 tick' if as_png else f'{last + 1} ticks'}, {target.stat().st_size / 1000:,.0f} kB")
