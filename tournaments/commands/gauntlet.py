"""The sub-command that plays a bot against all shipped fighters: `arena gauntlet`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table, progress_bar, say, say_lines, stdout_to_stderr
from policies.cli import complete_policy

if TYPE_CHECKING:
    from arena.local.venue import MatchRecord, News
    from tournaments.authoring.gauntlet import Encounter
    from tournaments.authoring.gauntlet_runs import Change, Comparison


def gauntlet(
    bot: Annotated[
        str, typer.Argument(metavar="BOT", autocompletion=complete_policy, help="A bot file, its folder, or exec:COMMAND.")
    ],
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="A,B,...",
            autocompletion=complete_policy,
            help="Whom it meets; may be repeated. All shipped fighters without it, slower planners apart.",
        ),
    ] = None,
    pairs: Annotated[int, typer.Option(min=1, max=100_000, help="Maps per opponent; each is played twice, sides swapped.")] = 20,
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a rule, as in side=16.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the maps and all chance; without another one, they are the same each time.")] = 1,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep journals and results here.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core without it.")] = None,
    as_json: AsJson = False,
) -> None:
    """Play a bot against all shipped fighters, and tell what has changed since the last time.

    Each gauntlet is played on the same maps, so two runs are compared pair by pair. The last 20 of a bot and its rules are kept.
    """
    from arena.bot_calls.marked_output import marked_prints
    from arena.compiling import compile_kernels, game_kernels
    from arena.folders import data_folder
    from arena.game.ruleset import load as load_rules
    from arena.game.ruleset import parse_overrides
    from policies.precompile import fighter_kernels
    from policies.registry import load
    from tournaments.authoring.check import find_bot
    from tournaments.authoring.feedback import Feedback
    from tournaments.authoring.gauntlet import find_opponents, name_bot, plan_gauntlet, play_gauntlet
    from tournaments.authoring.gauntlet_runs import Runs, compare
    from tournaments.league.entries import fingerprint_of, kind_of_file

    spec = find_bot(bot)
    ruleset = load_rules(rules).with_(parse_overrides(settings or []))
    place = spec if kind_of_file(spec) is None else str(Path(spec).resolve())  # before a bot leaves this folder
    data = None if data is None else data.absolute()
    with stdout_to_stderr():
        load(spec)
        opponents, left_out = find_opponents(spec, against)
        compile_kernels([*game_kernels(ruleset), *fighter_kernels([spec, *opponents])])
    fingerprint = fingerprint_of(place)
    name = name_bot(spec, opponents)
    runs = Runs(data_folder(data), name, place, ruleset.hash, str(seed))
    last, run = runs.last(), runs.begin()
    fixtures = plan_gauntlet(name, opponents, pairs, seed)
    feedback = Feedback([plan for plans in fixtures.values() for plan in plans])
    n_matches = 2 * pairs * len(opponents)
    with stdout_to_stderr(), progress_bar(n_matches, f"{name} against {len(opponents)} fighters") as advance, marked_prints():

        def hear(news: "News") -> None:
            advance(feedback.hear(news))

        def count(record: "MatchRecord") -> None:
            advance(feedback.count(record))

        try:
            met = play_gauntlet(
                ruleset,
                fixtures,
                {opponent: opponent for opponent in opponents} | {name: place},
                name,
                journals=run / "journals",
                n_workers=workers,
                on_news=hear,
                advance=count,
            )
        except KeyboardInterrupt:
            say(f"stopped after {feedback.n_ended} of {n_matches:,} matches; their journals are in {run / 'journals'}", err=True)
            raise
    scores = {one.opponent: one.pairs for one in met}
    runs.keep(run, fingerprint, scores)
    changes = None if last is None else compare(*last, fingerprint, scores)
    facts = {"bot": bot, "name": name, "rules": ruleset.name, "rules_hash": ruleset.hash, "seed": seed, "pairs": pairs}
    if as_json:
        print_json(_document(facts, met, changes, run, left_out))
        return
    _print_opponents(met, changes)
    say(f"{n_matches:,} matches, rules {ruleset.name}, seed {seed}; journals: {run / 'journals'}", *left_out)
    _print_worst_maps(met)
    for line in feedback.summary():
        say(line)
    _print_changes(changes, name)
    for one in met:
        traceback = one.tally.faults[name].first_traceback
        if traceback:
            say("", f"{name} first failed like this:", err=True)
            say_lines(traceback, err=True)
            break


def _document(
    facts: dict[str, Any], met: "list[Encounter]", changes: "Comparison | None", run: Path, left_out: list[str]
) -> dict[str, Any]:
    of = {} if changes is None else changes.opponents
    return {
        **facts,
        "journals": str(run / "journals"),
        "left_out": left_out,
        "opponents": [{**one.to_dict(), "change": of[one.opponent].to_dict() if one.opponent in of else None} for one in met],
        "since": None
        if changes is None
        else {"run": changes.run, "is_same_file": changes.is_same_file, "overall": changes.overall.to_dict()},
    }


def _print_opponents(met: "list[Encounter]", changes: "Comparison | None") -> None:
    of = {} if changes is None else changes.opponents
    rows = []
    for one in met:
        found, change = one.tally, of.get(one.opponent)
        own = next(faults for name, faults in found.faults.items() if name != one.opponent)
        rows.append(
            (
                one.opponent,
                f"{found.score:.3f}",
                f"{found.score_low:.3f} to {found.score_high:.3f}",
                found.wins,
                found.draws,
                found.losses,
                ", ".join(f"{n} {ending.replace('_', ' ')}" for ending, n in found.endings.items()),
                own.raised + own.illegal,
                f"{one.turns.median_ms:.2f}, {one.turns.p99_ms:.2f}",
                "" if change is None else _say_change(change),
            )
        )
    columns = ("opponent", "score", "95% interval", "wins", "draws", "losses", "ended by", "failed ticks", "ms a turn, p99")
    print_table((*columns, "since last run"), rows)


def _say_change(change: "Change") -> str:
    if change.score == change.score_before:
        return "as before" if change.verdict == "same" else change.verdict
    difference = f"{change.score - change.score_before:+.3f}"
    return f"{difference}, noise" if change.verdict == "same" else f"{difference}, {change.verdict}"


def _print_worst_maps(met: "list[Encounter]") -> None:
    from shlex import quote

    for one in met:
        if one.worst is not None:
            said = f"worst map against {one.opponent}: pair {one.worst.pair}, {one.worst.points:g} of 2"
            say(f"{said}: arena replay show {quote(one.worst.journal)}")


def _print_changes(changes: "Comparison | None", name: str) -> None:
    if changes is None:
        say("there is no earlier run to compare with; the next one will be compared with this")
        return
    overall = changes.overall
    file = "the same file" if changes.is_same_file else "an earlier version"
    said = f"since {changes.run}, {file}: {name} scores {overall.score:.3f} now and {overall.score_before:.3f} then"
    verdict = {"same": "no more than noise", "better": "better beyond noise", "worse": "worse beyond noise"}[overall.verdict]
    say(f"{said}, over the same {overall.n_pairs:,} pairs: {verdict} (p {overall.p_value:.3f})")
    for kind in ("better", "worse"):
        found = [opponent for opponent, change in changes.opponents.items() if change.verdict == kind]
        if found:
            say(f"{kind} beyond noise against {', '.join(found)}")
