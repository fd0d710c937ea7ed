"""The sub-commands by which fighters meet: `arena play`, `arena tournament` and `arena leaderboard`."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table, progress_bar, stdout_to_stderr
from arena.errors import InputError, UnknownNameError
from policies.cli import complete_policy

if TYPE_CHECKING:
    from arena.game.ruleset import Ruleset
    from tournaments.fixture import Tally
    from tournaments.league import League
    from tournaments.report import Report
    from tournaments.scheduler import Folders
    from tournaments.store import StoredLeague

FORMATS = ("text", "html", "md", "csv", "json")


def complete_league(incomplete: str) -> list[str]:
    """Return the shipped leagues, and the files, that begin like `incomplete`, for the shell."""
    from tournaments.league import LEAGUES

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
            load(spec)
    seed = secrets.randbelow(2**53) if seed is None else seed
    first, second = specs
    plans = plan_fixture("play", first, second, pairs, secret_from_seed(seed))
    finder = partial(load_entry, specs)
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
    """Name two entries by their fighters: a bot file by its stem, the second of two alike with a -2."""
    names = [Path(spec).stem if spec.endswith(".py") else spec for spec in (one, other)]
    names = [name.encode("utf-8", "replace").decode() for name in names]  # a file's name may be no text
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
    from tournaments.league import TEMPLATE

    if file.suffix != ".toml":
        raise InputError(f"{file} does not end in .toml, by which a league's file is known")
    try:
        with file.open("x", encoding="utf-8") as written:
            written.write(TEMPLATE)
    except FileExistsError as error:
        raise InputError(f"{file} is there already") from error
    except OSError as error:
        raise InputError(f"cannot write {file}: {error.strerror}") from error
    typer.echo(f"wrote {file}; edit it, then: arena tournament run {file}")


@tournament.command("run")
def run_league(
    league: LeagueName,
    venue: Annotated[str, typer.Option(metavar="network|local", help="Where to play; what the league says without it.")] = "",
    data: Data = None,
    db: Db = "",
    form: Format = "text",
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Play what is left of a league, and print the leaderboard. Stopped at any moment, it goes on from there."""
    import signal

    from arena.folders import data_folder
    from policies.registry import load
    from tournaments.league import VENUES, load_league
    from tournaments.report import make_report
    from tournaments.scheduler import Folders, Scheduler
    from tournaments.store import Store
    from tournaments.venues import VENUES as PLAY

    chosen = load_league(league)
    venue, form = _one_of("--venue", venue or chosen.venue, VENUES), _one_of("--format", "json" if as_json else form, FORMATS)
    folders = Folders(data=data_folder(data))
    with stdout_to_stderr():
        for spec in chosen.entries.values():
            load(spec)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end the processes of the league, too
    with Store(db or str(folders.data / "arena.db")) as store, Scheduler(chosen, store, folders) as scheduler:
        n_left, n_matches = len(scheduler.left), scheduler.n_matches
        if n_left < n_matches:
            typer.echo(f"{n_matches - n_left:,} of {n_matches:,} matches were played before", err=True)
        try:
            with stdout_to_stderr(), progress_bar(n_left, f"{chosen.name} ({venue})") as advance:
                for _ in scheduler.run(PLAY[venue]):
                    advance(1)
        except KeyboardInterrupt:
            n_stored = store.count(scheduler.row)
            typer.echo(f"\nstopped: {n_stored:,} of {n_matches:,} matches are stored; run it again to go on", err=True)
            raise
        report = make_report(scheduler.row, store.outcomes(scheduler.row), scheduler.secret)
    journals, page = folders.journals(chosen.name), folders.reports / f"{chosen.name}.html"
    _write(page, _render(report, "html", page, journals))
    _show(report, form, out, journals)
    typer.echo(f"report:   {page}\njournals: {journals}", err=form != "text")


@tournament.command("report")
def report_league(
    league: LeagueName, data: Data = None, db: Db = "", form: Format = "text", out: Out = None, as_json: AsJson = False
) -> None:
    """Print the report of a league from its stored results."""
    from tournaments.league import LEAGUES, load_league

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
    from tournaments.league import load_league
    from tournaments.schedule import count_matches
    from tournaments.store import Store

    name = load_league(league).name if league.endswith(".toml") else league
    with Store(db or str(data_folder(data) / "arena.db"), make=False) as store:
        rows = [store.get(name)] if name else store.leagues()
        facts = [
            {
                "league": row.name,
                "entries": len(row.facts["entries"]),
                "played": (played := store.count(row)),
                "planned": (planned := count_matches(len(row.facts["entries"]), row.n_pairs, is_gauntlet="hero" in row.facts)),
                "complete": played >= planned,
            }
            for row in rows
        ]
    if as_json:
        print_json(facts)
    else:
        print_table(("league", "entries", "played", "planned", "complete"), [tuple(fact.values()) for fact in facts])


def leaderboard(
    league: Annotated[str, typer.Option(metavar="NAME", help="The league; the one that was run last without it.")] = "",
    data: Data = None,
    db: Db = "",
    form: Format = "text",
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Print who leads a league, from its stored results."""
    _report(league, None, data, db, "json" if as_json else form, out)


def _report(name: str, league: "League | None", data: Path | None, db: str, form: str, out: Path | None) -> None:
    """Print the report of a stored league; the last one that was run if it has no name."""
    from arena.folders import data_folder
    from tournaments.report import make_report
    from tournaments.scheduler import Folders
    from tournaments.store import Store

    _one_of("--format", form, FORMATS)
    folders = Folders(data=data_folder(data))
    with Store(db or str(folders.data / "arena.db"), make=False) as store:
        row = store.get(name) if name else store.latest()
        outcomes = store.outcomes(row)
    secret = None if league is None else _secret_of(league, row, folders)
    _show(make_report(row, outcomes, secret), form, out, folders.journals(row.name))


def _secret_of(league: "League", row: "StoredLeague", folders: "Folders") -> bytes | None:
    """Return the secret that a stored league was played under, if it can be had."""
    from tournaments.secret import commit_to, find_secret

    try:
        secret = find_secret(league, folders.keys, may_make=False)
    except InputError:
        return None
    return secret if commit_to(secret) == row.facts["secret"] else None


def _one_of(option: str, value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise UnknownNameError(option, value, known)
    return value


def _render(report: "Report", form: str, page: Path, journals: Path) -> str:
    from tournaments.page import to_html
    from tournaments.report import to_csv, to_json, to_markdown, to_text

    if form == "html":
        return to_html(report, page, journals)
    return {"text": to_text, "md": to_markdown, "csv": to_csv, "json": to_json}[form](report)


def _show(report: "Report", form: str, out: Path | None, journals: Path) -> None:
    from tournaments.report import leaderboard as table
    from tournaments.report import summary

    if out is not None:
        _write(out, _render(report, form, out, journals))
        typer.echo(f"wrote {out}", err=True)
    elif form == "text":
        print_table(*table(report))
        for line in summary(report):
            typer.echo(line)
    else:
        typer.echo(_render(report, form, Path("report.html"), journals), nl=False)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error
