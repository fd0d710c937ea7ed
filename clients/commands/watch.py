"""`arena watch`: a running match on the terminal."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import clean, say, say_lines
from clients.commands.connecting import Authority, trust

if TYPE_CHECKING:
    from rich.console import RenderableType

    from clients.spectator import Frame


def watch(
    pit: Annotated[str, typer.Option(metavar="ADDRESS", help="Of the pit.")] = "tcp/127.0.0.1:7447",
    match: Annotated[str, typer.Option(metavar="ID", help="Which; the first that runs without it.")] = "",
    spectator_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of the pit's operator: shows both views, and the truth.")
    ] = None,
    authority: Authority = None,
) -> None:
    """Watch a match as it runs: the public facts, and with the spectator key what each team sees beside the truth.

    A pit that was opened with --public-delay shows the boards to everyone, so many ticks late.
    """
    from rich.console import Console
    from rich.live import Live

    from arena.display.text import is_live
    from arena.keyring.files import load_secret
    from arena.network.address import parse_address
    from clients.seat import read_result
    from clients.spectator import Frame, watch

    address = parse_address(pit)
    key = None if spectator_key is None else load_secret(spectator_key)
    console = Console()
    last: Frame | None = None
    names = ("?", "?")
    has_boards = key is not None

    def tell_waiting() -> None:
        say("no match is running; the next one is waited for", err=True)

    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        for chosen, frame in watch(address, authority, match, lambda pit_key: trust(address, pit_key), key, tell_waiting):
            names = frame.names or names
            has_boards = has_boards or frame.truth is not None
            if frame.ended is None and (frame.truth is not None or not has_boards):
                width, height = (console.width, console.height) if is_live(console) else (10_000, None)
                drawn = _draw(chosen, names, frame, width, height)
                if is_live(console):
                    live.update(drawn, refresh=True)
                else:
                    say_lines(_plain(drawn))
            last = frame
    if last is not None and last.ended is not None:
        say(read_result(last.ended).describe())


def _draw(match: str, names: tuple[str, str], frame: "Frame", width: int, height: int | None) -> "RenderableType":
    """Return what one tick looks like."""
    from rich.text import Text

    from arena.display.text import draw_row

    blue, red = frame.living or ("?", "?")
    title = (
        f"match {match}   blue {names[0]} against red {names[1]}   tick {frame.tick}   score {frame.score:+d}   "
        f"units {blue}:{red}{'   (as everyone is shown it, later)' if frame.is_past else ''}"
    )
    if frame.truth is None or frame.seen is None:
        return Text(clean(title))
    boards = [("what blue sees", frame.seen[0]), ("the truth", frame.truth), ("what red sees", frame.seen[1])]
    return draw_row(clean(title), boards, width, height=height)


def _plain(drawn: "RenderableType") -> str:
    """Return it without colours, for a file or a pipe."""
    from io import StringIO

    from rich.console import Console

    text = StringIO()
    Console(file=text, width=10_000).print(drawn)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"
