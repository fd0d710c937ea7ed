"""The sub-command that measures a trained fighter: `arena evaluate`."""

from typing import Annotated

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table, progress_bar, say, stdout_to_stderr
from arena.errors import InputError
from policies.cli import complete_policy

_USUAL = ["random", "patrol", "defend", "spiral", "roomba", "rush", "fighter"]


def evaluate(
    checkpoint: Annotated[
        str, typer.Argument(metavar="CHECKPOINT", autocompletion=complete_policy, help="A file, or a fighter.")
    ],
    against: Annotated[
        list[str], typer.Option(metavar="A,B,...", autocompletion=complete_policy, help="Whom it meets; may be repeated.")
    ] = _USUAL,
    pairs: Annotated[
        int, typer.Option(min=2, max=1_000_000, help="Maps per opponent; each is played twice, sides swapped.")
    ] = 500,
    rules: Annotated[str, typer.Option(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="The ruleset.")] = "paper",
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Change a rule, as in side=16, or how it plays, as in play.temperature=0."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the maps and the matches; training never uses them.")] = 20_000,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core without it.")] = None,
    as_json: AsJson = False,
) -> None:
    """Measure a fighter against others: a draw counts half, intervals are over pairs.

    Where the ruleset gives red no units, as exp1 does, it plays alone: how often it takes the flag, and how straight.
    """
    from dataclasses import asdict

    from arena.compiling import compile_kernels, game_kernels
    from arena.game.ruleset import load as load_rules
    from arena.game.ruleset import parse_overrides
    from arena.game.types import Team
    from policies.precompile import fighter_kernels
    from policies.registry import load, read_specs, set_more
    from tournaments.evaluation.evaluate import CANDIDATE
    from tournaments.evaluation.evaluate import evaluate as play_all
    from tournaments.evaluation.solo import play_alone

    opponents = read_specs(against)
    if not opponents or CANDIDATE in opponents:
        raise InputError(
            f"--against is {','.join(against)!r}; it must name fighters, divided by commas, and none called {CANDIDATE}"
        )
    changes = parse_overrides(settings or [])
    play = changes.pop("play", {})
    if not isinstance(play, dict):
        raise InputError(f"play is set to {play!r}; name what is to be set, as in --set play.temperature=0")
    checkpoint = set_more(checkpoint, play) if play else checkpoint
    ruleset = load_rules(rules).with_(changes)
    with stdout_to_stderr():
        fighters = (checkpoint, *opponents) if ruleset.team(Team.RED) else (checkpoint,)
        for spec in fighters:
            load(spec)
        compile_kernels([*game_kernels(ruleset), *fighter_kernels(fighters)])
    facts = {"fighter": checkpoint, "rules": ruleset.name, "rules_hash": ruleset.hash, "seed": seed, "pairs": pairs}
    if not ruleset.team(Team.RED):
        with stdout_to_stderr(), progress_bar(pairs, checkpoint) as advance:
            alone = play_alone(ruleset, checkpoint, matches=pairs, seed=seed, advance=advance, workers=workers)
        if as_json:
            print_json({**facts, "alone": alone.to_dict()})
            return
        row = (f"{alone.captures / alone.matches:.3f}", f"{alone.ticks:.1f}", f"{alone.shortest:.1f}", f"{alone.detour:.2f}")
        print_table(("captures", "ticks", "shortest way", "ticks / shortest"), [row])
        say(f"{pairs} matches alone, rules {ruleset.name}, seed {seed}")
        return
    with stdout_to_stderr(), progress_bar(2 * pairs * len(opponents), checkpoint) as advance:
        found = play_all(ruleset, checkpoint, opponents, pairs=pairs, seed=seed, advance=advance, workers=workers)
    if as_json:
        print_json({**facts, "against": {name: asdict(one) for name, one in found.items()}})
        return
    print_table(
        ("against", "wins", "draws", "losses", "score", "95% interval", "game score", "ticks", "endings"),
        [
            (
                name, one.wins, one.draws, one.losses, f"{one.score:.3f}", f"{one.score_low:.3f} to {one.score_high:.3f}",
                f"{one.mean_game_score:+.1f}", f"{one.ticks / (2 * pairs):.1f}",
                ", ".join(f"{n} {ending.replace('_', ' ')}" for ending, n in one.endings.items()),
            )
            for name, one in found.items()
        ],
    )  # fmt: skip
    say(f"{pairs} pairs each, rules {ruleset.name}, seed {seed}")
