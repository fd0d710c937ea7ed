"""The sub-command by which two fighters meet at once: `arena play`."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table, progress_bar, say, say_lines, stdout_to_stderr
from arena.errors import InputError
from policies.cli import complete_policy

if TYPE_CHECKING:
    from arena.game.ruleset import Ruleset
    from tournaments.fixture import Tally


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
    sandbox: Annotated[
        bool, typer.Option("--sandbox", help="Let bot files, programs and checkpoints see nothing of this machine.")
    ] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core without it.")] = None,
    as_json: AsJson = False,
) -> None:
    """Let two fighters play each other in this process, and count from A's side.

    Bot files share it with the board, and could read or write what the other thinks: this is for fighters that you trust, unless
    --sandbox gives each a process of its own behind a wall.
    """
    import secrets

    from arena.compiling import compile_kernels, game_kernels
    from arena.game.keys import secret_from_seed
    from arena.local.venue import play as play_matches
    from policies.precompile import fighter_kernels
    from policies.registry import load_entry
    from policies.workers.load import load_apart
    from tournaments.fixture import plan_fixture, tally

    ruleset = _ruleset(rules, settings or [], board)
    specs = _entries(one, other)
    finder = partial(load_apart if sandbox else load_entry, specs, cheats=True)
    with stdout_to_stderr():
        for name in specs:
            finder(name)
        compile_kernels([*game_kernels(ruleset), *fighter_kernels(specs.values())])
    seed = secrets.randbelow(2**53) if seed is None else seed
    first, second = specs
    plans = plan_fixture("play", first, second, pairs, secret_from_seed(seed))
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
            say("", f"{name} first failed like this:", err=True)
            say_lines(faults.first_traceback, err=True)


def _entries(one: str, other: str) -> dict[str, str]:
    """Name two entries by their fighters, the second of two alike with a -2."""
    from policies.registry import mark
    from tournaments.league.entries import name_of

    names = [name_of(mark(spec)).encode("utf-8", "replace").decode() for spec in (one, other)]  # a file's name may be no text
    if names[0] == names[1]:
        names[1] += "-2"
    return dict(zip(names, (one, other), strict=True))


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
    say(f"{2 * pairs} matches ({endings}), {result.ticks / (2 * pairs):.1f} ticks each; rules {ruleset.name}, seed {seed}")
    say(f"blue won {result.blue_wins}, red won {result.red_wins}")
    if journals:
        say(f"journals: {journals}")


def _n_faults(result: "Tally", name: str) -> int:
    return result.faults[name].raised + result.faults[name].illegal
