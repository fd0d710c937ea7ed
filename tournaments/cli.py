"""The sub-commands by which fighters meet: `arena play`, `arena tournament` and `arena leaderboard`."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, JsonProgress, complete_ruleset, print_json, print_table, progress_bar, stdout_to_stderr
from arena.errors import InputError, UnknownNameError
from policies.cli import complete_policy

if TYPE_CHECKING:
    from collections.abc import Mapping

    from arena.game.ruleset import Ruleset
    from tournaments.fixture import Tally
    from tournaments.league import League
    from tournaments.outcome import Outcome
    from tournaments.report import Report
    from tournaments.scheduler import Scheduler

FORMATS = ("text", "html", "md", "csv", "json")


def complete_league(incomplete: str) -> list[str]:
    """Return the shipped leagues, and the files, that begin like `incomplete`, for the shell."""
    from tournaments.league_file import LEAGUES

    return [name for name in (*LEAGUES, *map(str, sorted(Path().glob("*.toml")))) if name.startswith(incomplete)]


LeagueName = Annotated[
    str, typer.Argument(metavar="LEAGUE.toml|NAME", autocompletion=complete_league, help="A league's file, or one that ships.")
]
Data = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where results, journals and reports live; your data folder without it.")
]
Db = Annotated[str, typer.Option(metavar="URL|FILE", help="The store of results; arena.db in the data folder without it.")]
Format = Annotated[str, typer.Option("--format", metavar="|".join(FORMATS), help="What to print.")]
Out = Annotated[Path | None, typer.Option(metavar="FILE", help="Write it into this file instead.")]

tournament = typer.Typer(no_args_is_help=True, help="Run leagues: everyone meets everyone, and all are rated.")


def play(
    one: Annotated[str, typer.Argument(metavar="A", autocompletion=complete_policy, help="A fighter, or a bot file.")],
    other: Annotated[str, typer.Argument(metavar="B", autocompletion=complete_policy, help="Another, or the same.")],
    pairs: Annotated[int, typer.Option(min=1, max=1_000_000, help="Maps; each is played twice, sides swapped.")] = 10,
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a rule, as in side=16.")
    ] = None,
    board: Annotated[Path | None, typer.Option(metavar="FILE", help="Play on this board, drawn as text.")] = None,
    seed: Annotated[int | None, typer.Option(help="Makes the matches reproducible; a fresh one without it.")] = None,
    journals: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep each match's journal here.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core without it.")] = None,
    as_json: AsJson = False,
) -> None:
    """Let two fighters play each other in this process, and count from A's side."""
    import secrets

    from arena.game.keys import secret_from_seed
    from arena.referee.local import play as play_matches
    from policies.registry import load, load_entry
    from tournaments.fixture import plan_fixture, tally

    ruleset = _ruleset(rules, settings or [], board)
    specs = _entries(one, other)
    with stdout_to_stderr():
        for spec in specs.values():
            load(spec, cheats=True)
    seed = secrets.randbelow(2**53) if seed is None else seed
    first, second = specs
    plans = plan_fixture("play", first, second, pairs, secret_from_seed(seed))
    finder = partial(load_entry, specs, cheats=True)
    with stdout_to_stderr(), progress_bar(len(plans), f"{first} against {second}") as advance:
        records = []
        for record in play_matches(ruleset, plans, finder, journals=journals, n_workers=workers):
            records.append(record)
            advance(1)
    result = tally(first, second, records)
    if as_json:
        print_json(_facts([first, second], result, ruleset, seed, pairs, journals))
    else:
        _print_tally([first, second], result, ruleset, seed, pairs, journals)
    for name, faults in result.faults.items():
        if faults.first_traceback:
            typer.echo(f"\n{name} first failed like this:\n{faults.first_traceback}", err=True)


def _entries(one: str, other: str) -> dict[str, str]:
    """Name two entries by their fighters, the second of two alike with a -2."""
    from policies.registry import mark
    from tournaments.entries import name_of

    names = [name_of(mark(spec)).encode("utf-8", "replace").decode() for spec in (one, other)]  # a file's name may be no text
    if names[0] == names[1]:
        names[1] += "-2"
    return dict(zip(names, (one, other), strict=True))


def _ruleset(rules: str, settings: list[str], board: Path | None) -> "Ruleset":
    from arena.game.ruleset import load, parse_overrides

    overrides = parse_overrides(settings)
    if board is not None:
        try:
            overrides["board"] = board.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"cannot read the board {board}: {reason}") from error
    return load(rules).with_(overrides)


def _facts(names: list[str], result: "Tally", ruleset: "Ruleset", seed: int, pairs: int, journals: Path | None) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "a": names[0], "b": names[1], "rules": ruleset.name, "rules_hash": ruleset.hash, "seed": seed, "pairs": pairs,
        "journals": str(journals) if journals else None, **asdict(result),
    }  # fmt: skip


def _print_tally(names: list[str], result: "Tally", ruleset: "Ruleset", seed: int, pairs: int, journals: Path | None) -> None:
    print_table(
        ("", "wins", "draws", "losses", "score", "95% interval", "failed ticks"),
        [
            (
                names[0], result.wins, result.draws, result.losses, f"{result.score:.3f}",
                f"{result.score_low:.3f} to {result.score_high:.3f}", _n_faults(result, names[0]),
            ),
            (
                names[1], result.losses, result.draws, result.wins, f"{1 - result.score:.3f}",
                f"{1 - result.score_high:.3f} to {1 - result.score_low:.3f}", _n_faults(result, names[1]),
            ),
        ],
    )  # fmt: skip
    endings = ", ".join(f"{n} by {name.replace('_', ' ')}" for name, n in result.endings.items())
    typer.echo(f"{2 * pairs} matches ({endings}), {result.ticks / (2 * pairs):.1f} ticks each; rules {ruleset.name}, seed {seed}")
    typer.echo(f"blue won {result.blue_wins}, red won {result.red_wins}")
    if journals:
        typer.echo(f"journals: {journals}")


def _n_faults(result: "Tally", name: str) -> int:
    return result.faults[name].raised + result.faults[name].illegal


@tournament.command("init")
def write_league(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The file to write; one that is there is left alone.")],
) -> None:
    """Write a league's file, with comments, to be edited."""
    from tournaments.league_template import write_template

    write_template(file)
    typer.echo(f"wrote {file}; edit it, then: arena tournament run {file}")


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

    With --progress json, which --json implies, each line on stderr is a JSON object: an "event" (begin, invitation, match,
    stopped, end) and its facts; of a match how many are "played" "of" how many, at how many "per_s", and the seconds "left_s".
    """
    import signal

    from arena.folders import data_folder
    from tournaments.confine import NO_LIMITS
    from tournaments.formats import render, save
    from tournaments.league import VENUES
    from tournaments.league_file import load_league
    from tournaments.rehearsal import rehearse
    from tournaments.report import make_report
    from tournaments.scheduler import Folders, Scheduler
    from tournaments.store import Store

    chosen = load_league(league)
    venue, form = _one_of("--venue", venue or chosen.venue, VENUES), _one_of("--format", "json" if as_json else form, FORMATS)
    is_for_machines = _one_of("--progress", progress or ("json" if as_json else "bar"), ("bar", "json")) == "json"
    chosen.check_venue(venue)
    folders = Folders(data=data_folder(data))
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end the processes of the league, too
    limits = chosen.limits if venue == "network" else NO_LIMITS
    rehearse(chosen.entries, chosen.ruleset, folders.homes(chosen.name), limits)
    with Store(db or str(folders.data / "arena.db")) as store, Scheduler(chosen, store, folders) as scheduler:
        _play_league(scheduler, venue, f"{chosen.name} ({venue})", is_for_machines=is_for_machines)
        report = make_report(scheduler.row, store.outcomes(scheduler.row), scheduler.secret)
    journals, page = folders.journals(chosen.name), folders.reports / f"{chosen.name}.html"
    save(page, render(report, "html", page, journals))
    _show(report, form, out, journals)
    if is_for_machines:
        JsonProgress(0).say("end", report=str(page), journals=str(journals))
    else:
        typer.echo(f"report:   {page}\njournals: {journals}", err=form != "text")


def _play_league(scheduler: "Scheduler", venue: str, title: str, *, is_for_machines: bool) -> None:
    """Play what is left, and say how it goes."""
    from tournaments.venues import VENUES

    n_done, n_matches = scheduler.n_done, scheduler.n_matches
    lines = JsonProgress(n_matches, n_done)

    def tell(text: str, event: str, **facts: object) -> None:
        if is_for_machines:
            lines.say(event, **facts)
        else:
            typer.echo(text, err=True)

    if n_done or is_for_machines:
        tell(f"{n_done:,} of {n_matches:,} matches were played before", "begin", league=title, played=n_done, of=n_matches)
    if scheduler.is_over:
        return

    def invite(commands: "Mapping[str, str]") -> None:
        for name, command in commands.items():
            tell(f"{name} joins with: {command}", "invitation", entry=name, command=command)

    bar = nullcontext() if is_for_machines else progress_bar(n_matches - n_done, title)
    try:
        with stdout_to_stderr(), bar as advance:
            for outcome in scheduler.run(VENUES[venue], invite):
                if advance is not None:
                    advance(1)
                else:
                    lines.advance("match", identity=outcome.identity, ending=outcome.ending.name.lower(), winner=_winner(outcome))
    except KeyboardInterrupt:
        n_done = scheduler.n_done
        text = f"\nstopped: {n_done:,} of {n_matches:,} matches are stored; run it again to go on"
        tell(text, "stopped", played=n_done, of=n_matches)
        raise


def _winner(outcome: "Outcome") -> str | None:
    return None if outcome.winner is None else outcome.blue if outcome.winner.name == "BLUE" else outcome.red


@tournament.command("report")
def report_league(
    league: LeagueName, data: Data = None, db: Db = "", form: Format = "text", out: Out = None, as_json: AsJson = False
) -> None:
    """Print the report of a league from its stored results."""
    from tournaments.league_file import LEAGUES, load_league

    is_file = league.endswith(".toml") or league in LEAGUES
    read = load_league(league) if is_file else None
    _report(read.name if read else league, read, data, db, "json" if as_json else form, out)


@tournament.command("status")
def show_status(
    league: Annotated[str, typer.Argument(metavar="[LEAGUE.toml|NAME]", help="One league; none shows all.")] = "",
    data: Data = None,
    db: Db = "",
    as_json: AsJson = False,
) -> None:
    """Show how far leagues are."""
    from arena.folders import data_folder
    from tournaments.league_file import load_league
    from tournaments.progress import progress_of
    from tournaments.store import Store

    name = load_league(league).name if league.endswith(".toml") else league
    with Store(db or str(data_folder(data) / "arena.db"), make=False) as store:
        facts = [progress_of(store, row) for row in ([store.get(name)] if name else store.leagues())]
    if as_json:
        print_json(facts)
    else:
        print_table(("league", "entries", "played", "planned", "complete"), [tuple(fact.values()) for fact in facts])


def leaderboard(
    league: Annotated[str, typer.Option(metavar="NAME", help="The league; the one that was run last without it.")] = "",
    ladder: Annotated[bool, typer.Option("--ladder", help="Show a pit's ladder; --league is then the pit.")] = False,
    data: Data = None,
    db: Db = "",
    form: Format = "text",
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Print who leads a league, or a ladder, from the stored results."""
    form = "json" if as_json else form
    if ladder:
        from arena.folders import data_folder
        from tournaments.formats import save
        from tournaments.ladder_table import FORMATS as LADDER_FORMATS
        from tournaments.ladder_table import render_ladder

        text = render_ladder(db or str(data_folder(data) / "arena.db"), league, _one_of("--format", form, LADDER_FORMATS))
        typer.echo(text, nl=False) if out is None else save(out, text)
        return
    _report(league, None, data, db, form, out)


def _report(name: str, league: "League | None", data: Path | None, db: str, form: str, out: Path | None) -> None:
    """Print the report of a stored league; the last one that was run if it has no name."""
    from arena.folders import data_folder
    from tournaments.report import make_report
    from tournaments.scheduler import Folders
    from tournaments.secret import recall_secret
    from tournaments.store import Store

    _one_of("--format", form, FORMATS)
    folders = Folders(data=data_folder(data))
    with Store(db or str(folders.data / "arena.db"), make=False) as store:
        row = store.get(name) if name else store.latest()
        outcomes = store.outcomes(row)
    secret = None if league is None else recall_secret(league, folders.keys, row.facts["secret"])
    _show(make_report(row, outcomes, secret), form, out, folders.journals(row.name))


def _one_of(option: str, value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise UnknownNameError(option, value, known)
    return value


def _show(report: "Report", form: str, out: Path | None, journals: Path) -> None:
    from tournaments.formats import render, save
    from tournaments.report import leaderboard as table
    from tournaments.report import summary

    if out is not None:
        save(out, render(report, form, out, journals))
        typer.echo(f"wrote {out}", err=True)
    elif form == "text":
        print_table(*table(report))
        for line in summary(report):
            typer.echo(line)
    else:
        typer.echo(render(report, form, Path("report.html"), journals), nl=False)
