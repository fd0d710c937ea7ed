"""`arena join`: play matches in a pit, by a policy or as a person at the terminal."""

import signal
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import say, say_lines
from arena.errors import InputError
from clients.commands.connecting import Authority, trust
from policies.cli import complete_policy

if TYPE_CHECKING:
    from arena.policy import BatchFactory
    from clients.audit import Verdict
    from clients.feedback import Feedback
    from clients.human.turn_mailbox import TurnMailbox
    from clients.seat import Seat
    from clients.settings import ClientSettings


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
    patience: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="How long to look for a pit that is not there.")] = 60,
    rules: Annotated[str, typer.Option(help="Refuse to play any ruleset but this.")] = "",
    invite: Annotated[str, typer.Option(metavar="CODE", help="For a pit that wants one.")] = "",
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="The entry's key; that of its name without it.")] = None,
    authority: Authority = None,
    audit: Annotated[bool, typer.Option(help="Check each match's journal once it may be seen.")] = True,
    transcripts: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where to keep what each seat was shown; transcripts in --data without it."),
    ] = None,
    no_transcripts: Annotated[bool, typer.Option("--no-transcripts", help="Keep none.")] = False,
    explain: Annotated[
        bool, typer.Option("--explain", help="Have a planner say in them what it thought, which takes it time.")
    ] = False,
    sandbox: Annotated[bool, typer.Option("--sandbox/--no-sandbox", help="Let the policy see nothing of this machine.")] = False,
    limit: Annotated[
        list[str] | None, typer.Option(metavar="NAME=N", help="What it may use, as memory_mb=500; may be repeated.")
    ] = None,
    metrics: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Tell a monitor /healthz and /metrics there; as in 127.0.0.1:9102.")
    ] = "",
    alive: Annotated[Path | None, typer.Option(hidden=True, help="File to touch several times a second.")] = None,
    notes_file: Annotated[
        Path | None,
        typer.Option("--notes", hidden=True, help="File for a line for each limit that is met."),
    ] = None,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Where transcripts live; your data folder without it.")] = None,
) -> None:
    """Play matches in a pit, and print how each ended."""
    from contextlib import nullcontext
    from dataclasses import replace

    from arena.compiling import compile_kernels, game_kernels
    from arena.folders import data_folder
    from arena.game.ruleset import load as load_rules
    from arena.keyring.files import load, load_or_make
    from arena.keyring.ring import entry_key_path
    from arena.metrics import exposition
    from arena.metrics.server import serve_metrics
    from arena.network.address import parse_address
    from arena.protocol.topics import check_label
    from arena.sandbox.limits import BEHIND_A_WALL, NO_LIMITS
    from clients.feedback import Feedback
    from clients.monitor import ClientMonitor
    from clients.runner import Runner
    from clients.settings import ClientSettings
    from clients.versions import find_version
    from policies.precompile import fighter_kernels
    from policies.program import name_of
    from policies.registry import OWN, check_name
    from policies.registry import load as load_policy
    from policies.workers.policy import WorkerFactory

    if metrics:
        exposition.check()
    if team not in ("red", "blue", "any"):
        raise InputError(f"--team is {team!r}; it must be red, blue or any")
    where = parse_address(address or pit)
    notes: list[str] = []
    is_human = policy == "human" and not program
    if is_human and (sandbox or limit):
        raise InputError("--sandbox and --limit are for fighters, and --policy human is you")
    mailbox = _make_mailbox(autopilot, slots) if is_human else None
    if autopilot and mailbox is None:
        raise InputError("--autopilot is for --policy human")
    if explain and no_transcripts:
        raise InputError("--explain writes into the transcripts of the matches; leave out --no-transcripts")
    entry = check_label("the name", name or (name_of(program) if program else Path(policy).stem))
    spec = f"exec:{program}" if program else policy
    n_slots = slots if forever else min(slots, matches)
    workers = None
    make: BatchFactory
    if mailbox is not None:
        make = mailbox.make
    elif spec in OWN and not sandbox and not limit:
        make = load_policy(spec)
    else:
        check_name(spec)
        limits = (BEHIND_A_WALL if sandbox else NO_LIMITS).with_(limit or ())
        make = workers = WorkerFactory(
            spec, has_wall=sandbox, limits=limits, n_spare=n_slots, on_limit=partial(_note, notes_file)
        )
    rules_of_audit = game_kernels(load_rules("paper")) if audit else []  # which plays again, perhaps while another slot thinks
    compile_kernels([*rules_of_audit, *fighter_kernels([] if program else [autopilot or policy])])
    if workers is not None:
        workers.prepare()
    rules_hash = load_rules(rules).hash if rules else ""  # before a key is made
    identity = load_or_make(entry_key_path(entry.partition(".")[0])) if key is None else load(key)
    settings = ClientSettings(
        endpoint=where.endpoint,
        pit=where.pit,
        name=entry,
        team=team,
        make=make,
        n_matches=None if forever else matches,
        n_slots=n_slots,
        patience_s=patience,
        is_patient=is_human or workers is not None,
        rules_hash=rules_hash,
        identity=identity,
        invite=invite,
        version="" if is_human else find_version(spec, identity.public),
        trust=lambda pit_key: trust(where, pit_key, None if mailbox is None else notes.append),
        authority=authority,
        on_audit=_print_verdict if audit else None,
        transcripts=None if no_transcripts else data_folder(transcripts or data_folder(data) / "transcripts"),
        explains=explain,
    )
    if workers is not None:
        settings = replace(settings, count_ready=workers.count_ready)
    if mailbox is not None:
        _play_as_human(mailbox, settings, notes)
        return
    printed: set[str] = set()

    def on_wait(reason: str) -> None:
        if reason not in printed:
            printed.add(reason)
            say(f"{settings.name} waits {reason}", err=True)

    feedback, monitor = Feedback(), ClientMonitor()

    def on_seat(seat: "Seat") -> None:
        feedback.begin(seat)
        monitor.begin(seat)
        _print_seat(seat)

    def on_tick() -> None:
        monitor.see()
        if alive is not None:
            alive.touch()
        for sentence in feedback.news():
            say(sentence, err=True)

    def on_end(seat: "Seat") -> None:
        on_tick()
        monitor.count(seat)
        _print_result(seat, feedback)

    runner = Runner(settings, on_seat=on_seat, on_end=on_end, on_wait=on_wait, on_tick=on_tick)
    signal.signal(signal.SIGTERM, lambda *_: runner.stop())
    told = serve_metrics(metrics, monitor.read) if metrics else nullcontext()
    if workers is None:
        with told:
            runner.run()
        return
    try:
        workers.wake = runner.wake
        with told:
            runner.run()
    except KeyboardInterrupt as error:
        workers.explain(error)
        raise
    finally:
        workers.close()


def _note(file: Path | None, limit: str) -> None:
    """Say that the policy met a limit, and leave word for whoever started this client."""
    say(f"the policy met its limit of {limit}", err=True)
    if file is not None:
        try:
            with file.open("a", encoding="utf-8") as notes:
                notes.write(f"{limit}\n")
        except OSError as error:
            say(f"cannot note that in {file}: {error.strerror}", err=True)


def _make_mailbox(autopilot: str, slots: int) -> "TurnMailbox":
    """Return the mailbox of the person at this terminal, if there is one."""
    import os
    import sys
    from importlib import import_module

    from arena.extras import needs
    from clients.human.turn_mailbox import TurnMailbox
    from policies.registry import load

    with needs("tui", "--policy human"):
        import_module("textual")
    if not (sys.stdin.isatty() and sys.stdout.isatty()) or os.environ.get("TERM") == "dumb":
        raise InputError("--policy human wants a terminal to draw on and to type in; `arena web` has a page for playing")
    if slots != 1:
        raise InputError(f"--slots is {slots}; a person holds one seat at a time")
    if autopilot:
        load(autopilot)
    return TurnMailbox(autopilot)


def _play_as_human(mailbox: "TurnMailbox", settings: "ClientSettings", notes: list[str]) -> None:
    """Give the terminal to a person until all is played, and print the results and `notes` afterwards."""
    from dataclasses import replace

    from clients.feedback import Feedback
    from clients.runner import Runner
    from clients.terminal.app import PitApp

    over: list[Seat] = []
    audited: list[tuple[Seat, Verdict]] = []
    quiet = replace(
        settings, on_audit=None if settings.on_audit is None else lambda seat, verdict: audited.append((seat, verdict))
    )
    runner = Runner(quiet, on_seat=mailbox.on_seat, on_end=over.append, on_wait=mailbox.on_wait)
    mailbox.wake = runner.wake
    screen = PitApp(mailbox, runner.run, runner.stop)
    signal.signal(signal.SIGTERM, lambda *_: screen.leave())
    try:
        screen.run()
    finally:
        screen.close()
    for note in notes:
        say(note, err=True)
    for seat in over:
        _print_result(seat, Feedback())
    for seat, verdict in audited:
        _print_verdict(seat, verdict)
    if screen.failure is not None:
        raise screen.failure
    if mailbox.is_playing:
        say(f"match {mailbox.match}: left before its end; it is lost unless {settings.name} soon comes back", err=True)


def _print_seat(seat: "Seat") -> None:
    team, opponent = seat.team.name.lower(), seat.ticket.opponent
    say(f"match {seat.ticket.match}: {team} against {opponent}, rules {seat.ruleset.name}", err=True)
    if seat.ticket.public_delay:
        say(f"this pit shows everyone the board, {seat.ticket.public_delay} ticks late: flags and obstacles too", err=True)
    if seat.transcript is not None:
        say(f"its transcript is written to {seat.transcript}", err=True)


def _print_result(seat: "Seat", feedback: "Feedback") -> None:
    counted = (seat.ended.faults if seat.ended else {}).get(seat.team.name.lower(), {})
    faults = ", ".join(f"{n} {what}" for what, n in counted.items() if n)
    how = seat.result().describe(seat.team)
    say(f"match {seat.ticket.match}: {how}{f'; counted: {faults}' if faults else ''}")
    if seat.transcript is not None:
        say(f"its transcript is {seat.transcript}", err=True)
    lines, traceback = feedback.end(seat)
    for line in lines:
        say(f"match {seat.ticket.match}: {line}", err=True)
    if traceback:
        say("the policy first failed like this:", err=True)
        say_lines(traceback, err=True)


def _print_verdict(seat: "Seat", verdict: "Verdict") -> None:
    holds, finding = verdict
    say(f"match {seat.ticket.match}: {'warning: ' if holds is False else ''}{finding}", err=True)
