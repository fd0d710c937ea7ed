"""The sub-commands of leagues: `arena tournament` and `arena leaderboard`."""

from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import (
    AsJson,
    JsonProgress,
    compiling_bar,
    print_json,
    print_table,
    progress_bar,
    say,
    say_lines,
    stdout_to_stderr,
)
from arena.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from tournaments.reports.report import Report
    from tournaments.running.scheduler import Scheduler

FORMATS = ("text", "html", "md", "csv", "json")


def complete_league(incomplete: str) -> list[str]:
    """Return the shipped leagues, and the files, that begin like `incomplete`, for the shell."""
    from tournaments.league.file import LEAGUES

    return [name for name in (*LEAGUES, *map(str, sorted(Path().glob("*.toml")))) if name.startswith(incomplete)]


LeagueName = Annotated[
    str, typer.Argument(metavar="LEAGUE.toml|NAME", autocompletion=complete_league, help="A league's file, or one that ships.")
]
Data = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where results, journals and reports live; your data folder without it.")
]
Db = Annotated[str, typer.Option(metavar="URL|FILE", help="The store of results; arena.db in the data folder without it.")]
Format = Annotated[str, typer.Option("--format", metavar="|".join(FORMATS), help="What to print.")]
Ratings = Annotated[
    str, typer.Option(metavar="NAME", help="How to rate; davidson, normal (one fit), or a method of an installed package.")
]
Shares = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="Show shares beside ratings: maximal-lotteries, nash, alpha-rank, or of an installed package. May be repeated.",
    ),
]
AllVersions = Annotated[
    bool, typer.Option("--all-versions", help="Rate every version that entries have had, not their current ones alone.")
]
Out = Annotated[Path | None, typer.Option(metavar="FILE", help="Write it into this file instead.")]

tournament = typer.Typer(no_args_is_help=True, help="Run leagues: everyone meets everyone, and all are rated.")


@tournament.command("init")
def write_league(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The file to write; one that is there is left alone.")],
) -> None:
    """Write a league's file, with comments, to be edited."""
    from tournaments.league.template import write_template

    write_template(file)
    say(f"wrote {file}; edit it, then: arena tournament run {file}")


@tournament.command("run")
def run_league(
    league: LeagueName,
    venue: Annotated[str, typer.Option(metavar="network|local|ray", help="Where to play; what the league says without it.")] = "",
    data: Data = None,
    db: Db = "",
    form: Format = "text",
    out: Out = None,
    progress: Annotated[str, typer.Option(metavar="bar|json", help="How to tell on stderr how far it is.")] = "",
    as_json: AsJson = False,
) -> None:
    """Play what is left of a league, and print the leaderboard. Stopped at any moment, it goes on from there.

    With --progress json, which --json implies, each line on stderr is a JSON object: an "event" (compiling, begin, invitation,
    match, stopped, end) and its facts; of a match how many are "played" "of" how many, at how many "per_s", and the "left_s".
    """
    import signal

    from arena.compiling import compile_kernels, game_kernels
    from arena.folders import data_folder
    from policies.precompile import fighter_kernels
    from tournaments.league.file import load_league
    from tournaments.league.league import VENUES
    from tournaments.reports.formats import render, save
    from tournaments.reports.report import make_report
    from tournaments.running.preflight import check_entries
    from tournaments.running.progress import is_over
    from tournaments.running.scheduler import Folders, Scheduler
    from tournaments.running.slots import choose_slots, explain_slots
    from tournaments.store.store import Store
    from tournaments.venues.table import find_venue

    chosen = load_league(league)
    if chosen.season is not None:
        raise InputError(f"{chosen.name} is a season, whose entries are submitted; open it by: arena season open {league}")
    venue, form = one_of("--venue", venue or chosen.venue, VENUES), one_of("--format", "json" if as_json else form, FORMATS)
    is_for_machines = one_of("--progress", progress or ("json" if as_json else "bar"), ("bar", "json")) == "json"
    chosen.check_venue(venue)
    find_venue(venue)  # what it needs may not be installed
    folders = Folders(data=data_folder(data))
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end the processes of the league, too
    with Store(db or str(folders.data / "arena.db")) as store:
        think_s: dict[str, float] = {}
        if not is_over(store, chosen):
            kernels = [*game_kernels(chosen.ruleset), *fighter_kernels(chosen.entries.values())]
            compile_kernels(kernels, _compiling_lines if is_for_machines else compiling_bar)
            think_s = check_entries(chosen.entries, chosen.ruleset, chosen.sandboxes)
        slots = chosen.slots or choose_slots(think_s, chosen.time_control)
        why = explain_slots(slots, think_s) if chosen.slots is None and venue == "network" else ""
        with Scheduler(chosen, store, folders) as scheduler:
            if why and not is_for_machines:
                say(why, err=True)
            _play_league(scheduler, venue, f"{chosen.name} ({venue})", slots, is_for_machines=is_for_machines)
            report = make_report(scheduler.row, store.outcomes(scheduler.row))
    journals, page = folders.journals(chosen.name), folders.reports / f"{chosen.name}.html"
    save(page, render(report, "html", page, journals))
    _show(report, form, out, journals)
    if is_for_machines:
        JsonProgress(0).say("end", report=str(page), journals=str(journals))
    else:
        say(f"report:   {page}", f"journals: {journals}", err=form != "text")


@contextmanager
def _compiling_lines(n_kernels: int, expected_s: float) -> "Iterator[Callable[[], None]]":
    """Say to a program that kernels are compiled."""
    JsonProgress(0).say("compiling", kernels=n_kernels, expected_s=round(expected_s, 1))
    yield lambda: None


def _play_league(scheduler: "Scheduler", venue: str, title: str, slots: int, *, is_for_machines: bool) -> None:
    """Play what is left, and say how it goes."""
    from arena.bot_calls.marked_output import marked_prints
    from tournaments.venues.table import find_venue

    n_done, n_matches = scheduler.n_done, scheduler.n_matches
    lines = JsonProgress(n_matches, n_done)

    def tell(text: str, event: str, **facts: object) -> None:
        if is_for_machines:
            lines.say(event, **facts)
        else:
            say_lines(text, err=True)

    if n_done or is_for_machines:
        tell(f"{n_done:,} of {n_matches:,} matches were played before", "begin", league=title, played=n_done, of=n_matches)
    if scheduler.is_over:
        return

    def invite(commands: "Mapping[str, str]") -> None:
        for name, command in commands.items():
            tell(f"{name} joins with: {command}", "invitation", entry=name, command=command)

    bar = nullcontext() if is_for_machines else progress_bar(n_matches - n_done, title)
    try:
        with stdout_to_stderr(), bar as advance, marked_prints():
            for outcome in scheduler.run(find_venue(venue), invite, slots=slots):
                if advance is not None:
                    advance(1)
                else:
                    ending = outcome.result.ending.name.lower()
                    lines.advance("match", identity=outcome.identity, ending=ending, winner=outcome.winner)
    except KeyboardInterrupt:
        n_done = scheduler.n_done
        text = f"\nstopped: {n_done:,} of {n_matches:,} matches are stored; run it again to go on"
        tell(text, "stopped", played=n_done, of=n_matches)
        raise


@tournament.command("report")
def report_league(
    league: LeagueName,
    data: Data = None,
    db: Db = "",
    form: Format = "text",
    out: Out = None,
    ratings: Ratings = "",
    shares: Shares = None,
    all_versions: AllVersions = False,
    as_json: AsJson = False,
) -> None:
    """Print the report of a league from its stored results."""
    from tournaments.league.file import LEAGUES, load_league

    is_file = league.endswith(".toml") or league in LEAGUES
    read = load_league(league) if is_file else None
    _report(
        read.name if read else league, data, db, "json" if as_json else form, out, ratings, shares, has_all_versions=all_versions
    )


@tournament.command("close")
def close_league(league: LeagueName, data: Data = None, db: Db = "") -> None:
    """Close a league that is over, for good: its reports tell its secret from then on, and it takes no more pairs.

    All maps follow from the secret, so anyone can check those that were played; and could learn those of pairs still to come.
    """
    from arena.folders import data_folder
    from tournaments.league.file import load_league
    from tournaments.league.secret import recall_secret
    from tournaments.running.progress import progress_of
    from tournaments.running.scheduler import Folders
    from tournaments.store.store import Store

    chosen, folders = load_league(league), Folders(data=data_folder(data))
    if chosen.season is not None:
        raise InputError(f"{chosen.name} is a season, which is closed after its final; write its deadline into {league}")
    with Store(db or str(folders.data / "arena.db"), make=False) as store, store.lock(chosen.name):
        row = store.get(chosen.name)
        if not progress_of(store, row)["complete"]:
            raise InputError(f"league {row.name} is not over; arena tournament run goes on with it, and then it can be closed")
        secret = recall_secret(chosen, folders.keys, row.definition["secret"])
        if secret is None:
            raise InputError(f"the secret under which league {row.name} was played is neither in its file nor in {folders.keys}")
        store.close(row, secret)
    say(f"league {chosen.name} is closed; all its maps and fights follow from the secret {secret.hex()}")


@tournament.command("status")
def show_status(
    league: Annotated[str, typer.Argument(metavar="[LEAGUE.toml|NAME]", help="One league; none shows all.")] = "",
    data: Data = None,
    db: Db = "",
    as_json: AsJson = False,
) -> None:
    """Show how far leagues are."""
    from arena.folders import data_folder
    from tournaments.league.file import load_league
    from tournaments.running.progress import progress_of
    from tournaments.store.store import Store

    name = load_league(league).name if league.endswith(".toml") else league
    with Store(db or str(data_folder(data) / "arena.db"), make=False) as store:
        facts = [progress_of(store, row) for row in ([store.get(name)] if name else store.leagues())]
    if as_json:
        print_json(facts)
    else:
        print_table(
            ("league", "entries", "played", "planned", "complete"),
            [tuple("-" if value is None else value for value in fact.values()) for fact in facts],
        )


def leaderboard(
    league: Annotated[str, typer.Option(metavar="NAME", help="The league; the one that was run last without it.")] = "",
    ladder: Annotated[bool, typer.Option("--ladder", help="Show a pit's ladder; --league is then the pit.")] = False,
    data: Data = None,
    db: Db = "",
    form: Format = "text",
    out: Out = None,
    ratings: Ratings = "",
    shares: Shares = None,
    all_versions: AllVersions = False,
    as_json: AsJson = False,
) -> None:
    """Print who leads a league, or a ladder, from the stored results."""
    form = "json" if as_json else form
    if ladder:
        from arena.folders import data_folder
        from tournaments.reports.formats import save
        from tournaments.reports.ladder_table import FORMATS as LADDER_FORMATS
        from tournaments.reports.ladder_table import render_ladder

        if all_versions:
            raise InputError("--all-versions is of leagues; a ladder rates an entry as it is now")
        if shares:
            raise InputError("--shares are of leagues; a ladder has no cross table")
        if ratings:
            raise InputError("--ratings is how leagues are rated; a ladder keeps the ratings that its pit gave")
        text = render_ladder(db or str(data_folder(data) / "arena.db"), league, one_of("--format", form, LADDER_FORMATS))
        say_lines(text) if out is None else save(out, text)
        return
    _report(league, data, db, form, out, ratings, shares, has_all_versions=all_versions)


def _report(
    name: str,
    data: Path | None,
    db: str,
    form: str,
    out: Path | None,
    ratings: str,
    shares: list[str] | None,
    *,
    has_all_versions: bool,
) -> None:
    """Print the report of a stored league; the last one that was run if it has no name."""
    from arena.folders import data_folder
    from tournaments.ratings.methods import DEFAULT
    from tournaments.reports.report import make_report
    from tournaments.running.scheduler import Folders
    from tournaments.store.store import Store

    one_of("--format", form, FORMATS)
    folders = Folders(data=data_folder(data))
    with Store(db or str(folders.data / "arena.db"), make=False) as store:
        row = store.get(name) if name else store.latest()
        if row.is_season:
            raise InputError(f"{row.name} is a season; show its table by: arena season status {row.name}")
        outcomes = store.outcomes(row)
    report = make_report(row, outcomes, rating_method=ratings or DEFAULT, has_all_versions=has_all_versions, shares=shares or ())
    _show(report, form, out, folders.journals(row.name))


def one_of(option: str, value: str, known: tuple[str, ...]) -> str:
    """Return what an option was given, or refuse it, naming the nearest that there is."""
    if value not in known:
        raise UnknownNameError(option, value, known)
    return value


def _show(report: "Report", form: str, out: Path | None, journals: Path) -> None:
    from tournaments.reports.formats import render, save
    from tournaments.reports.leaderboard import as_table
    from tournaments.reports.report import summary

    if out is not None:
        save(out, render(report, form, out, journals))
        say(f"wrote {out}", err=True)
    elif form == "text":
        print_table(*as_table(report.standings.rows))
        for line in summary(report):
            say(line)
    else:
        say_lines(render(report, form, Path("report.html"), journals))
