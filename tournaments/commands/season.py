"""The sub-commands of seasons: `arena season`."""

from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import AsJson, JsonProgress, print_json, print_table, quantity, say
from arena.errors import ArenaError, InputError
from tournaments.commands.league import Data, Db, LeagueName, one_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from arena.metrics.definitions import Reading
    from arena.network.address import Address
    from tournaments.league.season import Phase
    from tournaments.season.service import Season, SeasonState
    from tournaments.store.season_store import SeasonStore

_TELL_EVERY_S = 60.0
_HUNG_S = 60.0
"""A season whose thread does nothing for so long is not well."""

season = typer.Typer(no_args_is_help=True, help="Run leagues that stay open: authors submit bots, and the table follows.")


@season.command("open")
def open_season(
    file: LeagueName,
    venue: Annotated[str, typer.Option(metavar="network|local|ray", help="Where to play; what the file says without it.")] = "",
    data: Data = None,
    db: Db = "",
    metrics: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Tell a monitor /healthz and /metrics there; as in 127.0.0.1:9101.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    r"""Take submissions and play them until the season is over. Stopped at any moment, it goes on from there.

    The file is a league's with a table \[season]. Authors submit with `arena submit BOT --to ADDRESS`, at the address that is
    printed first. With --json, each line on stderr is a JSON object: an "event" (open, phase, versions, match, stopped) and its
    facts.
    """
    import os
    import signal
    import time
    from contextlib import ExitStack
    from threading import Event

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy's threads would wait for cores that play; before it is imported

    from arena.compiling import compile_kernels, game_kernels
    from arena.folders import data_folder
    from arena.metrics.server import serve_metrics
    from policies.precompile import fighter_kernels
    from tournaments.authoring.check import OPPONENTS
    from tournaments.league.file import load_league
    from tournaments.league.league import VENUES
    from tournaments.running.preflight import check_entries
    from tournaments.running.scheduler import Folders
    from tournaments.season.service import Season, SeasonEvents
    from tournaments.store.season_store import SeasonStore

    chosen = load_league(file)
    if chosen.season is None:
        raise InputError(f"{file} is no season: write [season] into it, or play it as a league: arena tournament run {file}")
    venue = one_of("--venue", venue or chosen.venue, VENUES)
    chosen.check_venue(venue)
    folders = Folders(data=data_folder(data))
    lines, stop = JsonProgress(0), Event()

    def tell(text: str, event: str, **facts: object) -> None:
        if as_json:
            lines.say(event, **facts)
        else:
            say(text)

    def on_open(address: "Address") -> None:
        tell(f"season {chosen.name} is open: arena submit BOT --to {address}", "open", address=str(address))

    def on_phase(phase: "Phase") -> None:
        tell(f"season {chosen.name}: {phase}", "phase", phase=phase)

    def on_versions(new: list[str], gone: list[str]) -> None:
        parts = [f"{', '.join(new)} from now on"] * bool(new) + [f"{', '.join(gone)} no more"] * bool(gone)
        tell(f"plays: {'; '.join(parts)}", "versions", new=new, gone=gone)

    def on_invitation(commands: "Mapping[str, str]") -> None:
        for name, command in commands.items():
            tell(f"{name} joins with: {command}", "invitation", entry=name, command=command)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    events = SeasonEvents(on_open=on_open, on_phase=on_phase, on_versions=on_versions, on_invitation=on_invitation)
    with SeasonStore(db or str(folders.data / "arena.db")) as store, ExitStack() as beside:
        compile_kernels([*game_kernels(chosen.ruleset), *fighter_kernels([*chosen.entries.values(), *OPPONENTS])])
        think_s = check_entries(chosen.entries, chosen.ruleset, chosen.sandboxes)
        running = beside.enter_context(Season(chosen, store, folders, events=events, think_s=think_s))
        if metrics:
            beside.enter_context(serve_metrics(metrics, _reader(running, store)))
        told_at_s = time.monotonic()
        for outcome in running.run(venue, stop.is_set):
            if not as_json and time.monotonic() - told_at_s > _TELL_EVERY_S:
                told_at_s = time.monotonic()
                say(f"{running.state.n_matches:,} matches, {quantity(running.state.n_waiting, 'submission')} waiting")
            if as_json:
                ending = outcome.result.ending.name.lower()
                lines.say("match", identity=outcome.identity, ending=ending, winner=outcome.winner)
        if stop.is_set():
            tell(f"stopped; arena season open {file} goes on with it", "stopped")


def _reader(running: "Season", store: "SeasonStore") -> "Callable[[], Sequence[Reading]]":
    """Return what tells a monitor of a season."""
    import time

    from arena.metrics.definitions import FAULTS, MATCHES_ENDED, MATCHES_RUNNING, QUEUE, SEAT_P99_SECONDS, TICKS, Reading

    def read() -> "Sequence[Reading]":
        state: SeasonState = running.state
        quiet_s = time.monotonic() - state.looked_at_s
        if quiet_s > _HUNG_S:
            raise ArenaError(f"the season has done nothing for {quiet_s:.0f} s")
        return [
            Reading(MATCHES_RUNNING, state.n_playing),
            Reading(MATCHES_ENDED, state.endings),
            Reading(TICKS, state.n_ticks),
            Reading(FAULTS, state.faults),
            Reading(QUEUE, {"submissions": state.n_waiting}),
            Reading(SEAT_P99_SECONDS, state.p99s),
            *store.readings(),
        ]

    return read


@season.command("status")
def show_seasons(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="One season; none shows all.")] = "",
    data: Data = None,
    db: Db = "",
    as_json: AsJson = False,
) -> None:
    """Show the table of a season as it stood last, or how far all seasons are."""
    from arena.folders import data_folder
    from tournaments.reports.season_table import as_text_table
    from tournaments.store.season_store import SeasonStore

    with SeasonStore(db or str(data_folder(data) / "arena.db"), make=False) as store:
        rows = [store.get(name)] if name else store.leagues()
        tables = {row.name: store.standings(row) for row in rows if row.is_season}
        secrets = {row.name: row.secret.hex() for row in rows if row.secret is not None}
    if name and name not in tables:
        raise InputError(f"{name} is a league; show it by: arena tournament report {name}")
    if as_json:
        told = [{"season": one, **(table or {}), "secret": secrets.get(one)} for one, table in tables.items()]
        print_json(told[0] if name else told)
    elif name:
        table = tables[name]
        if table is None:
            raise InputError(f"season {name} has no table yet")
        print_table(*as_text_table(table["rows"]))
        say(f"season {name}: {table['phase']}, {table['matches']:,} matches, {table['waiting']} submissions wait")
        if name in secrets:
            say(f"all its maps and fights follow from the secret {secrets[name]}")
    else:
        print_table(
            ("season", "phase", "entries", "matches", "waiting"),
            [
                (one, "-", 0, 0, 0) if table is None
                else (one, table["phase"], len(table["rows"]), table["matches"], table["waiting"])
                for one, table in tables.items()
            ],
        )  # fmt: skip
