"""The sub-command of those who play over the network: `arena join`."""

import signal
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import AsJson, print_json, print_table
from arena.errors import InputError, PolicyError
from policies.cli import complete_policy

if TYPE_CHECKING:
    from clients.seat import Seat


def join(
    address: Annotated[str, typer.Argument(help="As `arena serve` prints it; without it, --pit.")] = "",
    team: Annotated[str, typer.Option(help="red, blue or any.")] = "any",
    policy: Annotated[str, typer.Option(autocompletion=complete_policy, help="A fighter, or a bot file.")] = "rush",
    name: Annotated[str, typer.Option(help="What to be called; the policy's name without it.")] = "",
    pit: Annotated[str, typer.Option(metavar="ENDPOINT", help="Zenoh endpoint of the pit.")] = "tcp/127.0.0.1:7447",
    matches: Annotated[int, typer.Option(min=1, help="Leave after so many.")] = 1,
    forever: Annotated[bool, typer.Option("--forever", help="Play until the pit has no more matches.")] = False,
    slots: Annotated[int, typer.Option(min=1, max=256, help="Seats to hold at once.")] = 1,
    patience: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="How long to look for a pit that is lost.")] = 60,
    rules: Annotated[str, typer.Option(help="Refuse to play any ruleset but this.")] = "",
) -> None:
    """Play matches in a pit, and print how each ended."""
    from pathlib import Path

    from arena.address import parse_address
    from arena.game.ruleset import load as load_rules
    from arena.protocol.topics import check_chunk
    from clients.runner import Runner, Settings
    from policies.registry import load

    if team not in ("red", "blue", "any"):
        raise InputError(f"--team is {team!r}; it must be red, blue or any")
    where = parse_address(address or pit)
    make = load(policy)
    settings = Settings(
        endpoint=where.endpoint,
        pit=where.pit,
        name=check_chunk("the name", name or Path(policy).stem),
        team=team,
        make=make,
        n_matches=None if forever else matches,
        n_slots=slots if forever else min(slots, matches),
        patience_s=patience,
        rules_hash=load_rules(rules).hash if rules else "",
    )
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


def _say_seat(seat: "Seat") -> None:
    team, opponent = seat.team.name.lower(), seat.ticket.opponent
    typer.echo(f"match {seat.ticket.match}: {team} against {opponent}, rules {seat.ruleset.name}", err=True)


def _say_end(seat: "Seat") -> None:
    result = seat.result()
    outcome = "draw" if result.winner is None else "win" if result.winner is seat.team else "loss"
    how = result.ending.name.lower().replace("_", " ")
    why = f" ({result.reason})" if result.reason else ""
    counted = (seat.ended.faults if seat.ended else {}).get(seat.team.name.lower(), {})
    faults = ", ".join(f"{n} {what}" for what, n in counted.items() if n)
    typer.echo(
        f"match {seat.ticket.match}: {outcome} as {seat.team.name.lower()} by {how}{why} after {result.ticks} ticks, "
        f"score {result.score:+d}{f'; counted: {faults}' if faults else ''}"
    )
    first = seat.faults().first_traceback
    if first:
        typer.echo(f"the policy first failed like this:\n{first}", err=True)


def doctor(
    pit: Annotated[str, typer.Option(metavar="ADDRESS", help="Also ask whether this pit answers.")] = "",
    as_json: AsJson = False,
) -> None:
    """Check that this machine can run the arena, and that a pit answers; exit 1 if something is amiss."""
    from clients.doctor import examine

    findings = examine(pit)
    if as_json:
        print_json([{"what": what, "ok": is_ok, "finding": finding} for what, is_ok, finding in findings])
    else:
        print_table(("what", "ok", "finding"), findings)
    if not all(is_ok for _, is_ok, _ in findings):
        raise typer.Exit(1)
