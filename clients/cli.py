"""The sub-command of those who play over the network: `arena join`."""

import signal
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import AsJson, print_json, print_table
from arena.errors import InputError, PolicyError
from policies.cli import complete_policy

if TYPE_CHECKING:
    from rich.console import RenderableType

    from arena.network.address import Address
    from clients.audit import Verdict
    from clients.human.turn_mailbox import Desk
    from clients.seat import Seat
    from clients.settings import Settings
    from clients.spectator import Frame

Authority = Annotated[
    Path | None, typer.Option(metavar="FILE", help="For arena+tls://...: who vouches for the pit's certificate (PEM).")
]


def join(
    address: Annotated[str, typer.Argument(help="As `arena serve` prints it; without it, --pit.")] = "",
    team: Annotated[str, typer.Option(help="red, blue or any.")] = "any",
    policy: Annotated[str, typer.Option(autocompletion=complete_policy, help="A fighter, a bot file, or human: you.")] = "rush",
    program: Annotated[
        str, typer.Option("--exec", metavar="CMD", help="A program that speaks JSON lines, instead of --policy.")
    ] = "",
    autopilot: Annotated[
        str, typer.Option(autocompletion=complete_policy, help="With --policy human: who moves units without orders.")
    ] = "",
    name: Annotated[str, typer.Option(help="What to be called; the policy's name without it.")] = "",
    pit: Annotated[str, typer.Option(metavar="ENDPOINT", help="Zenoh endpoint of the pit.")] = "tcp/127.0.0.1:7447",
    matches: Annotated[int, typer.Option(min=1, help="Leave after so many.")] = 1,
    forever: Annotated[bool, typer.Option("--forever", help="Play until the pit has no more matches.")] = False,
    slots: Annotated[int, typer.Option(min=1, max=256, help="Seats to hold at once.")] = 1,
    patience: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="How long to look for a pit that is lost.")] = 60,
    rules: Annotated[str, typer.Option(help="Refuse to play any ruleset but this.")] = "",
    invite: Annotated[str, typer.Option(metavar="CODE", help="For a pit that wants one.")] = "",
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="The entry's key; that of its name without it.")] = None,
    authority: Authority = None,
    audit: Annotated[bool, typer.Option(help="Check each match's journal once it may be seen.")] = True,
    transcripts: Annotated[bool, typer.Option(help="Keep what each seat was shown, for `arena replay show`.")] = True,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Where transcripts live; your data folder without it.")] = None,
) -> None:
    """Play matches in a pit, and print how each ended."""
    from arena.folders import data_folder
    from arena.game.ruleset import load as load_rules
    from arena.keyring.files import load, load_or_make
    from arena.keyring.ring import entry_key_path
    from arena.network.address import parse_address
    from arena.protocol.topics import check_chunk
    from clients.runner import Runner
    from clients.settings import Settings
    from policies.registry import load as load_policy

    if team not in ("red", "blue", "any"):
        raise InputError(f"--team is {team!r}; it must be red, blue or any")
    where = parse_address(address or pit)
    notes: list[str] = []
    is_human = policy == "human" and not program
    desk = _sit_at_desk(autopilot, slots) if is_human else None
    if autopilot and desk is None:
        raise InputError("--autopilot is for --policy human")
    make = load_policy(f"exec:{program}" if program else policy) if desk is None else desk.make
    entry = check_chunk("the name", name or Path((program.split() or [policy])[0] if program else policy).stem)
    settings = Settings(
        endpoint=where.endpoint,
        pit=where.pit,
        name=entry,
        team=team,
        make=make,
        n_matches=None if forever else matches,
        n_slots=slots if forever else min(slots, matches),
        patience_s=patience,
        is_patient=is_human,
        rules_hash=load_rules(rules).hash if rules else "",
        identity=load_or_make(entry_key_path(entry)) if key is None else load(key),
        invite=invite,
        trust=lambda pit_key: trust(where, pit_key, None if desk is None else notes.append),
        authority=authority,
        on_audit=_say_audit if audit else None,
        transcripts=data_folder(data_folder(data) / "transcripts") if transcripts else None,
    )
    if desk is not None:
        _play_as_human(desk, settings, notes)
        return
    said: set[str] = set()

    def on_wait(reason: str) -> None:
        if reason not in said:
            said.add(reason)
            typer.echo(f"{settings.name} waits {reason}", err=True)

    runner = Runner(settings, on_seat=_say_seat, on_end=_say_end, on_wait=on_wait)
    signal.signal(signal.SIGTERM, lambda *_: runner.stop())
    try:
        runner.run()
    except PolicyError as error:
        raise PolicyError(f"{policy}: {error}") from error


def _sit_at_desk(autopilot: str, slots: int) -> "Desk":
    """Return the desk of the person at this terminal, if there is one."""
    import os
    import sys

    from clients.human.turn_mailbox import Desk
    from policies.registry import load

    if not (sys.stdin.isatty() and sys.stdout.isatty()) or os.environ.get("TERM") == "dumb":
        raise InputError("--policy human wants a terminal to draw on and to type in; `arena web` has a page for playing")
    if slots != 1:
        raise InputError(f"--slots is {slots}; a person holds one seat at a time")
    if autopilot:
        load(autopilot)
    return Desk(autopilot)


def _play_as_human(desk: "Desk", settings: "Settings", notes: list[str]) -> None:
    """Give the terminal to a person until all is played, and say afterwards what could not be said meanwhile: `notes` too."""
    from dataclasses import replace

    from clients.runner import Runner
    from clients.terminal.app import Pit

    over: list[Seat] = []
    audited: list[tuple[Seat, Verdict]] = []
    quiet = replace(
        settings, on_audit=None if settings.on_audit is None else lambda seat, verdict: audited.append((seat, verdict))
    )
    runner = Runner(quiet, on_seat=desk.meet, on_end=over.append, on_wait=desk.wait)
    desk.wake = runner.wake
    screen = Pit(desk, runner.run, runner.stop)
    signal.signal(signal.SIGTERM, lambda *_: screen.leave())
    try:
        screen.run()
    finally:
        screen.close()
    for note in notes:
        typer.echo(note, err=True)
    for seat in over:
        _say_end(seat)
    for seat, verdict in audited:
        _say_audit(seat, verdict)
    if screen.failure is not None:
        raise screen.failure
    if desk.is_playing:
        typer.echo(f"match {desk.match}: left before its end; it is lost unless {settings.name} soon comes back", err=True)


def trust(where: "Address", pit_key: bytes, say: Callable[[str], None] | None = None) -> None:
    """Refuse a pit that is not the one of the address, or not the one that was there before.

    `say` is told if it is new here; without it, that is printed.
    """
    from arena.keyring.known_pits import check_pit
    from arena.protocol.identity import from_text, to_text

    place = f"{where.endpoint.partition('/')[2]}/{where.pit}"
    if check_pit(place, pit_key, from_text(where.fingerprint) if where.fingerprint else None):
        note = f"this pit is new here; from now on {place} must show the key {to_text(pit_key)}"
        (partial(typer.echo, err=True) if say is None else say)(note)


def _say_seat(seat: "Seat") -> None:
    team, opponent = seat.team.name.lower(), seat.ticket.opponent
    typer.echo(f"match {seat.ticket.match}: {team} against {opponent}, rules {seat.ruleset.name}", err=True)


def _say_end(seat: "Seat") -> None:
    counted = (seat.ended.faults if seat.ended else {}).get(seat.team.name.lower(), {})
    faults = ", ".join(f"{n} {what}" for what, n in counted.items() if n)
    how = seat.result().describe(seat.team)
    typer.echo(f"match {seat.ticket.match}: {how}{f'; counted: {faults}' if faults else ''}")
    first = seat.faults().first_traceback
    if first:
        typer.echo(f"the policy first failed like this:\n{first}", err=True)


def _say_audit(seat: "Seat", verdict: "Verdict") -> None:
    holds, finding = verdict
    typer.echo(f"match {seat.ticket.match}: {'warning: ' if holds is False else ''}{finding}", err=True)


def doctor(
    pit: Annotated[str, typer.Option(metavar="ADDRESS", help="Also ask whether this pit answers.")] = "",
    authority: Authority = None,
    as_json: AsJson = False,
) -> None:
    """Check that this machine can run the arena, and that a pit answers; exit 1 if something is amiss."""
    from clients.doctor import examine

    findings = examine(pit, authority)
    if as_json:
        print_json([{"what": what, "ok": is_ok, "finding": finding} for what, is_ok, finding in findings])
    else:
        print_table(("what", "ok", "finding"), findings)
    if not all(is_ok for _, is_ok, _ in findings):
        raise typer.Exit(1)


def watch(
    pit: Annotated[str, typer.Option(metavar="ADDRESS", help="Of the pit.")] = "tcp/127.0.0.1:7447",
    match: Annotated[str, typer.Option(metavar="ID", help="Which; the first that runs without it.")] = "",
    spectator_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of the pit's operator: shows both views, and the truth.")
    ] = None,
    authority: Authority = None,
) -> None:
    """Watch a match as it runs: the public facts, and with the spectator key what each team sees beside the truth."""
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
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        for chosen, frame in watch(address, authority, match, lambda pit_key: trust(address, pit_key), key):
            names = frame.names or names
            if frame.ended is None and (key is None or frame.truth is not None):
                width, height = (console.width, console.height) if is_live(console) else (10_000, None)
                drawn = _draw(chosen, names, frame, width, height)
                if is_live(console):
                    live.update(drawn, refresh=True)
                else:
                    typer.echo(_plain(drawn), nl=False)
            last = frame
    if last is not None and last.ended is not None:
        typer.echo(read_result(last.ended).describe())


def _draw(match: str, names: tuple[str, str], frame: "Frame", width: int, height: int | None) -> "RenderableType":
    """Return what one tick looks like."""
    from rich.text import Text

    from arena.display.text import draw_row

    blue, red = frame.living or ("?", "?")
    title = (
        f"match {match}   blue {names[0]} against red {names[1]}   tick {frame.tick}   score {frame.score:+d}   "
        f"units {blue}:{red}"
    )
    if frame.truth is None or frame.seen is None:
        return Text(title)
    boards = [("what blue sees", frame.seen[0]), ("the truth", frame.truth), ("what red sees", frame.seen[1])]
    return draw_row(title, boards, width, height=height)


def _plain(drawn: "RenderableType") -> str:
    """Return it without colours, for a file or a pipe."""
    from io import StringIO

    from rich.console import Console

    text = StringIO()
    Console(file=text, width=10_000).print(drawn)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"


admin = typer.Typer(no_args_is_help=True, help="Tell a running pit what to do, with the key in its data folder.")
_Pit = Annotated[str, typer.Option("--pit", metavar="ADDRESS", help="Of the pit.")]
_Data = Annotated[Path | None, typer.Option("--data", metavar="DIR", help="The pit's own; your data folder without it.")]


@admin.command("kick")
def kick(
    target: Annotated[str, typer.Argument(metavar="NAME|KEY")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """Have an entry forfeit what it plays, and send it away; it may come back."""
    _tell("kick", target, pit, data, authority)


@admin.command("ban")
def ban(
    target: Annotated[str, typer.Argument(metavar="NAME|KEY")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """Kick an entry, and never let its key in again."""
    _tell("ban", target, pit, data, authority)


@admin.command("close")
def close(pit: _Pit = "", data: _Data = None, authority: Authority = None) -> None:
    """Begin no more matches; the pit ends with the last that runs."""
    _tell("close", "the pit", pit, data, authority)


@admin.command("abort")
def abort(
    match: Annotated[str, typer.Argument(metavar="MATCH")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """End a match as void."""
    _tell("abort", match, pit, data, authority)


@admin.command("release-name")
def release_name(
    name: Annotated[str, typer.Argument(metavar="NAME")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """Give a name back, for another key to take."""
    _tell("release-name", name, pit, data, authority)


def _tell(command: str, target: str, pit: str, data: Path | None, authority: Path | None) -> None:
    from arena.folders import data_folder
    from arena.keyring.files import load
    from arena.network.address import Address, parse_address
    from clients import admin as operator

    address = parse_address(pit) if pit else Address()
    typer.echo(operator.command(address, authority, load(data_folder(data) / "keys" / "pit.key"), command, target))
