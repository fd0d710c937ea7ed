"""The command that opens a pit: `arena serve`, with its ladder and its web page."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from arena.console import complete_ruleset, say
from arena.errors import InputError
from arena.match.time_control import MOST_S

_TURN_S, _HUMAN_TURN_S = 1.0, 30.0


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
        float | None, typer.Option(min=0.001, max=MOST_S, metavar="SECONDS", help="For each turn; 1, or 30 with --humans.")
    ] = None,
    humans: Annotated[bool, typer.Option("--humans", help="People play here: turns last longer.")] = False,
    bank: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="Extra time of a seat for a whole match.")] = 10.0,
    grace: Annotated[
        float, typer.Option(min=0, max=MOST_S, metavar="SECONDS", help="How long a seat that vanished keeps its place.")
    ] = 10.0,
    missed: Annotated[int, typer.Option(min=1, max=1_000_000, help="Turns missed in a row that forfeit a match.")] = 10,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Where journals live; your data folder without it.")] = None,
    most_matches: Annotated[
        int | None, typer.Option(min=1, max=10_000, metavar="N", help="Matches at once; beyond, clients wait. 2000 without it.")
    ] = None,
    workers: Annotated[
        int,
        typer.Option(
            min=0,
            max=64,
            metavar="N",
            help="Processes that referee the matches; more than one use more cores. 0 leaves all to --machine.",
        ),
    ] = 1,
    machine: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST=N",
            help="Have N more processes referee on another machine, as ssh reaches it, which then holds the pit's key; may be "
            "given again.",
        ),
    ] = None,
    machine_program: Annotated[str, typer.Option(metavar="PATH", help="What is the arena on other machines.")] = "arena",
    ladder: Annotated[
        bool, typer.Option("--ladder", help="Match whoever comes by rating and waiting time, and rate them.")
    ] = False,
    ladder_method: Annotated[
        str, typer.Option(metavar="NAME", help="Which ladder rates; openskill, or one of an installed package.")
    ] = "",
    db: Annotated[
        str, typer.Option(metavar="URL|FILE", help="The store of a ladder; arena.db in the data folder without it.")
    ] = "",
    public_delay: Annotated[
        int | None,
        typer.Option(
            metavar="TICKS",
            min=1,
            help="Show everyone the boards of running matches, so much later: flags and obstacles too, which a friend may tell a "
            "team. Entries are told. Without it, nobody sees a board before its match is over.",
        ),
    ] = None,
    fsync: Annotated[bool, typer.Option("--fsync", help="Let every tick outlive a power cut, at its price.")] = False,
    invite: Annotated[Path | None, typer.Option(metavar="FILE", help="Let in only who has one of its codes, one a line.")] = None,
    metrics: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Tell a monitor /healthz and /metrics there; as in 127.0.0.1:9100.")
    ] = "",
    certificate: Annotated[
        tuple[Path, Path] | None, typer.Option(metavar="CERT KEY", help="For --listen tls/HOST:PORT: two PEM files.")
    ] = None,
    web: Annotated[
        int | None, typer.Option(metavar="PORT", min=1, max=65535, help="Show the pit in the browser, on this machine.")
    ] = None,
    web_host: Annotated[
        str, typer.Option(metavar="HOST", help="Where --web listens; the default lets in nobody but this machine.")
    ] = "127.0.0.1",
    web_name: Annotated[
        list[str] | None,
        typer.Option(metavar="HOST", help="A name by which browsers reach --web, beside --web-host; may be given again."),
    ] = None,
    no_web: Annotated[bool, typer.Option("--no-web", help="Do not; so it is without --web.")] = False,
) -> None:
    """Open a pit: a match begins when a red and a blue seat are taken. Unfinished matches are taken up again.

    With --ladder, entries that wait are matched by the pit, on a map of their own, and rated; `arena leaderboard --ladder` tells.
    """
    import os
    import signal
    import sys
    from contextlib import ExitStack, nullcontext
    from dataclasses import replace

    from arena.compiling import compile_kernels, game_kernels
    from arena.folders import data_folder
    from arena.game.keys import new_secret, secret_from_seed
    from arena.game.ruleset import load, parse_overrides
    from arena.keyring.files import load_or_make, load_or_make_secret
    from arena.match.time_control import TimeControl
    from arena.metrics import exposition
    from arena.metrics.server import serve_metrics
    from arena.network.access import Certificate
    from arena.network.address import Address
    from arena.pit.monitor import PitMonitor
    from arena.pit.pit import Pit, PitSettings
    from arena.pit.register import Register, read_invites
    from arena.pit.workers.machines import HERE, parse_machine
    from arena.protocol.topics import MOST_WORKERS, check_chunk
    from tournaments.web_page import PagePlace, check, web_page

    if db and not ladder:
        raise InputError("--db is where a ladder is kept; give --ladder as well")
    if ladder_method and not ladder:
        raise InputError("--ladder-method is how a ladder rates; give --ladder as well")
    if public_delay is not None and seed is not None:
        raise InputError("--public-delay shows maps that --seed may bring again; give one of the two")
    if web is not None and no_web:
        raise InputError("--web and --no-web exclude each other")
    if web is None and (web_host != "127.0.0.1" or web_name):
        raise InputError("--web-host and --web-name say where --web is reached; give --web PORT as well")
    place = None if web is None else PagePlace(port=web, host=web_host, names=tuple(web_name or ()))
    if place is not None:
        check(place)
    if metrics:
        exposition.check()
    if seed is not None:
        say("arena: warning: anyone can try small seeds; strangers should not be seated under --seed", err=True)
    if public_delay is not None:
        say(
            f"arena: warning: everyone sees the board {public_delay} ticks late: whoever has a friend who watches knows where "
            "the flag and the obstacles are, and where units were",
            err=True,
        )
    afar = [one for text in machine or () for one in parse_machine(text, machine_program)]
    here = [HERE] * workers if workers > 1 or afar else []
    if not workers and not afar:
        raise InputError("--workers 0 leaves all matches to other machines; give --machine as well")
    if len(here) + len(afar) > MOST_WORKERS:
        raise InputError(f"{len(here) + len(afar)} workers are too many for one pit; {MOST_WORKERS} are the most")
    n_cores = len(os.sched_getaffinity(0))
    if workers > n_cores:
        say(f"arena: warning: {workers} workers share {n_cores} cores; more than --workers {n_cores} is of no use here", err=True)
    open_ladder = _find_ladder(ladder_method) if ladder else None
    folder = data_folder(data)
    identity = load_or_make(folder / "keys" / "pit.key")
    chosen = PitSettings(
        address=Address(endpoint=listen, pit=check_chunk("the pit's name", pit), fingerprint=identity.fingerprint),
        identity=identity,
        spectator_key=load_or_make_secret(folder / "keys" / "spectator.key"),
        public_delay=public_delay or 0,
        register=Register(folder / "register.json", None if invite is None else read_invites(invite)),
        certificate=None if certificate is None else Certificate(certificate=certificate[0], key=certificate[1]),
        ruleset=load(rules).with_(parse_overrides(settings or [])),
        secret=new_secret() if seed is None else secret_from_seed(seed),
        time_control=TimeControl(
            turn_time_s=turn_time or (_HUMAN_TURN_S if humans else _TURN_S),
            bank_s=bank,
            grace_s=grace,
            most_missed=missed,
        ),
        journals=folder / "journals",
        n_matches=matches,
        fsync=fsync,
        most_matches=most_matches,
        workers=(*here, *afar),
    )

    compile_kernels(game_kernels(chosen.ruleset))

    def on_open(n_resumed: int) -> None:
        say(f"pit open at {chosen.address} (rules {chosen.ruleset.name})")
        say(f"join with: arena join {chosen.address} --team any --policy rush{' --forever' if ladder else ''}")
        if n_resumed:
            say(f"{n_resumed} unfinished matches wait for their seats to come back")
        if place is not None:
            sys.stdout.flush()  # the page says its address on the same stdout
            beside.enter_context(web_page(chosen.address, place, folder, db, None if certificate is None else certificate[0]))

    opened = open_ladder(db or str(folder / "arena.db"), pit, chosen.ruleset.hash) if open_ladder else nullcontext()
    with opened as kept, ExitStack() as beside:
        monitor = PitMonitor() if metrics else None
        if monitor is not None:
            of_store = _readings_of(kept)
            beside.enter_context(serve_metrics(metrics, lambda: [*monitor.read(), *of_store()], monitor.check_health))
        server = Pit(replace(chosen, ladder=kept, monitor=monitor))
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: server.stop())
        n_left = server.run(on_open, lambda played: say(_describe(played)))
    if n_left:
        say(f"{n_left} matches are unfinished; arena serve with the same --data takes them up again")


def _find_ladder(method: str) -> Any:
    from tournaments.ladder.methods import DEFAULT, find_ladder  # and SQL, which takes half a second

    return find_ladder(method or DEFAULT)


def _readings_of(ladder: Any) -> Callable[[], list[Any]]:
    """Return what tells a monitor of the store of our own ladder; of no other is anything known."""
    if ladder is None:
        return list
    from tournaments.ladder.ladder import RatedLadder

    return ladder.readings if isinstance(ladder, RatedLadder) else list


def _describe(played: Any) -> str:
    """Return a line on how a match ended, with what was counted."""
    header = played.header
    counted = [f"{team.name.lower()} {n} {what}" for team, seat in played.seats.items() for what, n in seat.faults().items() if n]
    faults = f"; counted: {', '.join(counted)}" if counted else ""
    return f"{header.identity}: blue {header.blue}, red {header.red}: {played.result.describe()}{faults}"
