"""The sub-command by which two fighters meet at once: `arena play`."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table, progress_bar, say, say_lines, stdout_to_stderr
from arena.errors import InputError
from arena.match.time_control import MOST_S
from policies.cli import complete_policy

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from contextlib import ExitStack

    from arena.game.ruleset import Ruleset
    from arena.local.venue import Load, MatchRecord, News, OnNews
    from arena.records.plan import MatchPlan
    from tournaments.authoring.feedback import Feedback
    from tournaments.fixture import Tally

    PlayMatches = Callable[[Ruleset, Sequence[MatchPlan], Path | None, OnNews], Iterator[MatchRecord]]


def play(
    one: Annotated[str, typer.Argument(metavar="A", autocompletion=complete_policy, help="A fighter, or a bot file.")],
    other: Annotated[str, typer.Argument(metavar="B", autocompletion=complete_policy, help="Another, or the same.")],
    pairs: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1_000_000,
            help="Maps; each is played twice, sides swapped. 10 without it; at most 2,000 with --until-sure.",
        ),
    ] = None,
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a rule, as in side=16.")
    ] = None,
    board: Annotated[Path | None, typer.Option(metavar="FILE", help="Play on this board, drawn as text.")] = None,
    seed: Annotated[int | None, typer.Option(help="Makes the matches reproducible; a fresh one without it.")] = None,
    journals: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep each match's journal here.")] = None,
    transcripts: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Keep what each seat saw, ordered, logged and drew here.")
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Keep transcripts that say what planners thought; without DIR, in your data folder.")
    ] = False,
    sandbox: Annotated[
        bool, typer.Option("--sandbox", help="Let bot files, programs and checkpoints see nothing of this machine.")
    ] = False,
    turn_time: Annotated[
        float | None, typer.Option(min=0.001, max=MOST_S, metavar="SECONDS", help="Run a pit's clock; one match at a time.")
    ] = None,
    bank: Annotated[
        float | None, typer.Option(min=0, metavar="SECONDS", help="With --turn-time: extra time for a match; 10 without it.")
    ] = None,
    until_sure: Annotated[
        bool, typer.Option("--until-sure", help="Play until one is shown to be better, or both to be equal.")
    ] = False,
    margin: Annotated[
        float | None,
        typer.Option(
            min=1, max=2e3, metavar="ELO", help="With --until-sure: the difference to be found; 50 without it. Less takes longer."
        ),
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core without it.")] = None,
    is_stepped: Annotated[
        bool, typer.Option("--step", help="Play the first match alone, tick by tick, on this terminal.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Let two fighters play each other in this process, and count from A's side.

    Bot files share it with the board, and could read or write what the other thinks: this is for fighters that you trust, unless
    --sandbox gives each a process of its own behind a wall. With --turn-time each has a process of its own, too, and is late, or
    forfeits, as in a pit.
    """
    import secrets
    from contextlib import ExitStack

    from arena.bot_calls.marked_output import marked_prints
    from arena.compiling import compile_kernels, game_kernels
    from arena.folders import data_folder, make_folder
    from arena.game.keys import secret_from_seed
    from policies.precompile import fighter_kernels
    from tournaments.authoring.feedback import Feedback
    from tournaments.authoring.until_sure import MARGIN_ELO, MOST_PAIRS, Comparison, play_until_sure
    from tournaments.fixture import plan_fixture, tally

    if margin is not None and not until_sure:
        raise InputError("--margin is the difference that --until-sure looks for; give both, or neither")

    ruleset = _ruleset(rules, settings or [], board)
    specs = _entries(one, other)
    seed = secrets.randbelow(2**53) if seed is None else seed
    if explain and transcripts is None:
        transcripts = data_folder(None) / "transcripts" / f"seed-{seed}"
    make_load = partial(_loader, specs, transcripts, sandbox=sandbox, explain=explain)
    first, second = specs
    if is_stepped:
        others = as_json or until_sure or any(option is not None for option in (pairs, turn_time, workers))
        plan = plan_fixture("play", first, second, 1, secret_from_seed(seed))[0]
        _step(ruleset, plan, specs, journals, make_load, others=others)
        return
    kept = None if journals is None else journals.absolute()  # a bot may leave this folder
    pairs = pairs or (MOST_PAIRS if until_sure else 10)
    comparison = Comparison.begin(first, second, margin or MARGIN_ELO) if until_sure else None
    plans = plan_fixture("play", first, second, pairs, secret_from_seed(seed))
    feedback = Feedback(plans)
    with ExitStack() as fighters:
        with stdout_to_stderr():
            if turn_time is None:
                play_matches = _without_clock(specs, bank, make_load, sandbox=sandbox, workers=workers)
            elif transcripts is not None:
                raise InputError("transcripts are kept without a clock; leave out --turn-time, or join a pit, which keeps them")
            else:
                play_matches = _on_the_clock(specs, turn_time, bank, fighters, sandbox=sandbox, workers=workers)
            if kept is not None:
                make_folder(kept, f"cannot keep journals in {journals}")
            compile_kernels([*game_kernels(ruleset), *fighter_kernels(specs.values())])
        with stdout_to_stderr(), progress_bar(len(plans), f"{first} against {second}") as advance, marked_prints():

            def hear(news: "News") -> None:
                advance(feedback.hear(news))

            def play_some(some: "Sequence[MatchPlan]") -> "Iterator[MatchRecord]":
                for record in play_matches(ruleset, some, kept, hear):
                    advance(feedback.count(record))
                    yield record

            try:
                if comparison is None:
                    records = list(play_some(plans))
                else:
                    comparison, records = play_until_sure(plans, comparison, play_some, partial(say, err=True))
            except KeyboardInterrupt:
                say(feedback.stopped(first, second), err=True)
                raise
    result, pairs = tally(first, second, records), len(records) // 2
    if as_json:
        facts = _facts([first, second], result, feedback, ruleset, seed, pairs, turn_time, journals)
        print_json(facts if comparison is None else {**facts, "until_sure": comparison.to_dict()})
    else:
        _print_tally([first, second], result, ruleset, seed, pairs, turn_time, journals)
        if one != other and second not in _own_names(one, other):
            say(f"{second} is {other}")
        if comparison is not None:
            say(comparison.says())
        for line in feedback.summary():
            say(line)
    for name, faults in result.faults.items():
        if faults.first_traceback:
            say("", f"{name} first failed like this:", err=True)
            say_lines(faults.first_traceback, err=True)


def _without_clock(
    specs: dict[str, str], bank: float | None, make_load: "Callable[[], Load]", *, sandbox: bool, workers: int | None
) -> "PlayMatches":
    """Return what plays in this process and its workers."""
    from arena.local.venue import play as play_locally
    from policies.registry import is_file_or_program

    if bank is not None:
        raise InputError("--bank is extra time for turns; give a turn its time by --turn-time")
    load = make_load()
    if sandbox and workers is None and any(map(is_file_or_program, specs.values())):
        workers = 1  # their own processes think side by side already
    return lambda ruleset, plans, journals, on_news: play_locally(
        ruleset, plans, load, journals=journals, n_workers=workers, on_news=on_news
    )


def _loader(specs: dict[str, str], transcripts: Path | None, *, sandbox: bool, explain: bool) -> "Load":
    """Return what loads the fighters by the names of their entries; each has been loaded once."""
    from arena.folders import make_folder
    from policies.registry import load_entry
    from policies.workers.load import load_apart
    from tournaments.authoring.transcripts import load_transcribed
    from tournaments.league.entries import kind_of_file

    load_one = partial(load_apart if sandbox else load_entry, cheats=True)
    placed = {name: spec if kind_of_file(spec) is None else str(Path(spec).absolute()) for name, spec in specs.items()}
    folder = None if transcripts is None else transcripts.absolute()  # before a bot leaves this folder
    for name in specs:
        load_one(specs, name)
    load = partial(load_one, placed)
    if folder is None:
        return load
    make_folder(folder, f"cannot keep transcripts in {transcripts}")
    if explain:
        say(f"what planners think is kept in {folder}; `arena replay show FILE` shows one match", err=True)
    return partial(load_transcribed, load, dict(zip(specs, reversed(specs), strict=True)), folder, explains=explain)


def _on_the_clock(
    specs: dict[str, str],
    turn_time_s: float,
    bank_s: float | None,
    running: "ExitStack",
    *,
    sandbox: bool,
    workers: int | None,
) -> "PlayMatches":
    """Return what plays as a pit does; `running` closes the processes of the fighters."""
    from dataclasses import replace

    from arena.match.time_control import TimeControl
    from arena.policy import BatchFactory
    from arena.sandbox.limits import BEHIND_A_WALL, NO_LIMITS
    from policies.registry import OWN, check_name, load
    from policies.workers.policy import WorkerFactory
    from tournaments.venues.timed import play as play_timed

    if workers is not None:
        raise InputError(
            "--turn-time plays one match at a time, so that nobody is late by this machine's making; leave out --workers"
        )
    fighters: dict[str, BatchFactory] = {}
    for name, spec in specs.items():
        if spec in OWN and not sandbox:
            fighters[name] = load(spec)
            continue
        check_name(spec)
        apart = WorkerFactory(spec, has_wall=sandbox, limits=BEHIND_A_WALL if sandbox else NO_LIMITS, n_spare=1)
        running.callback(apart.close)
        apart.prepare()
        fighters[name] = apart
    time_control = TimeControl(turn_time_s=turn_time_s)
    if bank_s is not None:
        time_control = replace(time_control, bank_s=bank_s)
    return lambda ruleset, plans, journals, on_news: play_timed(
        ruleset, plans, fighters, time_control, journals=journals, on_news=on_news
    )


def _step(
    ruleset: "Ruleset",
    plan: "MatchPlan",
    specs: dict[str, str],
    journals: Path | None,
    make_load: "Callable[[], Load]",
    *,
    others: bool,
) -> None:
    """Play one match as somebody looks at it, from A's side."""
    from arena.compiling import compile_kernels, game_kernels
    from policies.precompile import fighter_kernels
    from tournaments.authoring.stepping import step_through

    if others:
        raise InputError(
            "--step is for somebody who looks at one match: leave out --pairs, --json, --until-sure, --turn-time and --workers"
        )
    with stdout_to_stderr():
        load = make_load()
        compile_kernels([*game_kernels(ruleset), *fighter_kernels(specs.values())])
    step_through(ruleset, plan, load, plan.team(next(iter(specs))), journals=journals)


def _entries(one: str, other: str) -> dict[str, str]:
    """Name two entries by their fighters, the second of two alike with a -2."""
    names = _own_names(one, other)
    if names[0] == names[1]:
        names[1] += "-2"
    return dict(zip(names, (one, other), strict=True))


def _own_names(*specs: str) -> list[str]:
    from policies.registry import mark
    from tournaments.league.entries import name_of

    return [name_of(mark(spec)) for spec in specs]


def _ruleset(rules: str, settings: list[str], board: Path | None) -> "Ruleset":
    from arena.files import read_text
    from arena.game.ruleset import load, parse_overrides

    overrides = parse_overrides(settings)
    if board is not None:
        try:
            overrides["board"] = read_text(board)
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"cannot read the board {board}: {reason}") from error
    return load(rules).with_(overrides)


def _facts(
    names: list[str],
    result: "Tally",
    feedback: "Feedback",
    ruleset: "Ruleset",
    seed: int,
    pairs: int,
    turn_time: float | None,
    journals: Path | None,
) -> dict[str, Any]:
    from dataclasses import asdict

    faults = {name: {**asdict(result.faults[name]), "reasons": feedback.facts(name)} for name in names}
    return {
        "a": names[0], "b": names[1], "rules": ruleset.name, "rules_hash": ruleset.hash, "seed": seed, "pairs": pairs,
        "turn_time_s": turn_time, "journals": str(journals) if journals else None, **asdict(result), "faults": faults,
    }  # fmt: skip


def _print_tally(
    names: list[str],
    result: "Tally",
    ruleset: "Ruleset",
    seed: int,
    pairs: int,
    turn_time: float | None,
    journals: Path | None,
) -> None:
    counted = ("failed ticks",) if turn_time is None else ("failed ticks", "late turns")
    print_table(
        ("", "wins", "draws", "losses", "score", "95% interval", *counted),
        [
            (
                names[0], result.wins, result.draws, result.losses, f"{result.score:.3f}",
                f"{result.score_low:.3f} to {result.score_high:.3f}", *_faults(result, names[0], turn_time),
            ),
            (
                names[1], result.losses, result.draws, result.wins, f"{1 - result.score:.3f}",
                f"{1 - result.score_high:.3f} to {1 - result.score_low:.3f}", *_faults(result, names[1], turn_time),
            ),
        ],
    )  # fmt: skip
    endings = ", ".join(f"{n} by {name.replace('_', ' ')}" for name, n in result.endings.items())
    say(f"{2 * pairs} matches ({endings}), {result.ticks / (2 * pairs):.1f} ticks each; rules {ruleset.name}, seed {seed}")
    say(f"blue won {result.blue_wins}, red won {result.red_wins}")
    if journals:
        say(f"journals: {journals}")


def _faults(result: "Tally", name: str, turn_time: float | None) -> list[int]:
    """Return on how many ticks an entry failed, and on a clock, how many of its turns were late."""
    faults = result.faults[name]
    failed = faults.raised + faults.illegal
    if turn_time is None:
        return [failed]
    from tournaments.venues.timed import LATE

    return [failed, faults.reasons.get(LATE, ("", 0))[1]]
