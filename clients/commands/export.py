"""The sub-command that draws a match for elsewhere: `arena replay export`."""

from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import quantity, say
from arena.errors import InputError

if TYPE_CHECKING:
    from arena.game.types import Team
    from arena.records.journal import Journal
    from arena.records.transcript import Transcript

_FORMS = ("gif", "png", "html", "journal")


def export_match(
    file: Annotated[Path, typer.Argument(help="A journal, or the transcript of a seat.")],
    as_gif: Annotated[bool, typer.Option("--gif", help="Every tick, moving.")] = False,
    as_png: Annotated[bool, typer.Option("--png", help="One tick.")] = False,
    as_html: Annotated[bool, typer.Option("--html", help="The web page's replay as one file, for any browser.")] = False,
    as_journal: Annotated[
        bool, typer.Option("--journal", help="The journal itself as a file of its own, where a bundle holds it.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where to, and by its suffix what; without it here, named like the match."),
    ] = None,
    tick: Annotated[int | None, typer.Option(help="Which tick --png shows; the last without it.")] = None,
    team: Annotated[str | None, typer.Option(help="Whose view of a journal a picture shows: blue (without it) or red.")] = None,
    cell: Annotated[int, typer.Option(min=6, max=64, metavar="PX", help="Width of a cell.")] = 16,
    speed: Annotated[float, typer.Option(min=0.1, max=50.0, help="Ticks per second, of --gif.")] = 4.0,
) -> None:
    """Draw a match as a picture for papers and talks, or as a page: the boards that `arena replay show` shows.

    Of a journal, a team's view at the left and the truth at the right, with the fights marked; of a transcript, what its seat saw
    and remembered. An HTML file has all views, its controls, and what the bot of a transcript noted.

    Or take a journal out of the bundle that a large local league keeps many in: FILE is its folder and its name, as
    `arena replay list` prints them.
    """
    from arena.compiling import compile_rules
    from arena.display.team_option import read_team
    from arena.records.journal import Journal
    from arena.records.recording import load_recording

    form = _choose_form(out, gif=as_gif, png=as_png, html=as_html, journal=as_journal)
    if form != "png" and tick is not None:
        raise InputError(f"--tick is for --png; --{form} shows every tick")
    view = read_team(team, file)
    if form in ("html", "journal") and team is not None:
        raise InputError(f"--team is for pictures; --{form} has both views")
    recording = load_recording(file)
    target = out or Path(file.with_suffix(f".{form}").name)
    if form == "journal":
        if not isinstance(recording, Journal):
            raise InputError(f"{file} is a transcript, and --journal is for journals")
        say(f"{target}: {quantity(len(recording.ticks), 'tick')}, {_write_journal(file, target):,} bytes")
        return
    if isinstance(recording, Journal):  # which is played again
        compile_rules()
    n_ticks = _write_page(file, target) if form == "html" else _draw(recording, target, form, tick, view, cell, speed)
    say(f"{target}: {quantity(n_ticks, 'tick')}, {target.stat().st_size / 1000:,.0f} kB")


def _choose_form(out: Path | None, **flags: bool) -> str:
    chosen = [form for form, is_chosen in flags.items() if is_chosen]
    if not chosen and out is not None and out.suffix[1:] in _FORMS:
        chosen = [out.suffix[1:]]
    if len(chosen) != 1:
        raise InputError(
            "say one of --gif, for every tick, --png, for one, --html, for a page, and --journal, for the journal itself"
        )
    return chosen[0]


def _write_journal(file: Path, target: Path) -> int:
    from arena.records.framing import load
    from arena.records.journal_folder import read_recorded

    data, is_ours = load(file, bytes, read_recorded), False
    try:
        with target.open("xb") as copy:  # over no other journal
            is_ours = True
            return copy.write(data)
    except OSError as error:
        if is_ours:
            target.unlink(missing_ok=True)  # half a journal, in whose place the next try would find a file
        raise InputError(f"cannot write {target}: {error.strerror}") from error


def _write_page(file: Path, target: Path) -> int:
    from arena.display.replay_frames import describe_recording
    from arena.records.framing import load
    from arena.records.journal_folder import read_recorded
    from clients.web.page_file import page_file

    match = load(file, describe_recording, read_recorded)
    try:
        target.write_text(page_file(match), encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror or error}") from error
    return len(match["ticks"])


def _draw(
    recording: "Journal | Transcript", target: Path, form: str, tick: int | None, team: "Team | None", cell: int, speed: float
) -> int:
    from arena.console import progress_bar
    from arena.display.image import draw, frames_of, last_tick, save_gif, save_png

    last = last_tick(recording)
    if tick is not None and not 0 <= tick <= last:
        raise InputError(f"--tick is {tick}; the match has {f'ticks 0 to {last}' if last >= 0 else 'no ticks'}")
    if last < 0:
        raise InputError("the match has no ticks, so there is nothing to draw")
    frames = frames_of(recording, team)
    if form == "png":
        save_png(draw(next(islice(frames, last if tick is None else tick, None)), cell), target)
        return 1
    with progress_bar(last + 1, "drawing", each="ticks") as advance:
        images = []
        for frame in frames:
            images.append(draw(frame, cell))
            advance(1)
    save_gif(images, target, speed)
    return last + 1
