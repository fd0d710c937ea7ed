"""The command that measures: `arena bench`.

Our own benchmarks stand in `benchmarks/` of a checkout, a module each with a function `run`; they are no part of what is
installed. Other people's are entry points of the group `arena.benchmarks`.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import typer

from arena.cli import plug_ins
from arena.console import AsJson, print_json, print_table, say
from arena.errors import ArenaError, InputError, UnknownNameError
from arena.match.time_control import MOST_S

Progress = Callable[[str], None]
"""Says in a few words what a benchmark is at."""
Benchmark = Callable[..., dict[str, Any]]
"""Is given its `Progress`, and returns numbers, nested under names as deep as it likes.

One that has a parameter `minutes` goes on for as long as it is told; what it does untold is short enough for `--all`. One that
has a parameter `turn_time` holds turns against a clock of so many seconds; one with a parameter `seed` draws what it does by it.
One with a parameter `matches` is told, as a text, how many matches it plays at once, and one with `workers` how many a pit has.

Where promises are tried, `broken` among the results lists in sentences those that were not kept; the command then ends with exit
code 1.
"""


_FOR_THOSE = {
    "minutes": "--minutes is for benchmarks that measure for as long as they are told",
    "turn_time": "--turn-time is for benchmarks that count late turns",
    "seed": "--seed is for benchmarks that draw what they do",
    "matches": "--matches is for benchmarks of many matches at once",
    "workers": "--workers is for benchmarks of a pit that may have some",
}
GROUP = "arena.benchmarks"
"""Entry points of other people's benchmarks."""
_FOLDER = Path(__file__).parents[2] / "benchmarks"
"""Ours, where this is a checkout."""


def _find() -> dict[str, Callable[[], Benchmark]]:
    """Return what loads each benchmark, by name."""
    own = {path.stem: partial(_load_own, path.stem) for path in _FOLDER.glob("*.py") if path.stem != "__init__"}
    return own | {name: point.load for name, point in plug_ins(GROUP).items()}


def _load_own(name: str) -> Benchmark:
    if str(_FOLDER.parent) not in sys.path:
        sys.path.append(str(_FOLDER.parent))
    benchmark: Benchmark = import_module(f"benchmarks.{name}").run
    return benchmark


def complete_benchmark(incomplete: str) -> list[str]:
    """Return the names of benchmarks that begin like `incomplete`, for the shell."""
    return sorted(name for name in _find() if name.startswith(incomplete))


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME...", autocompletion=complete_benchmark, help="Which to run; none lists them."),
    ] = None,
    run_all: Annotated[bool, typer.Option("--all", help="Run every one.")] = False,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, help="How long, of those that measure for as long as they are told.")
    ] = None,
    turn_time: Annotated[
        float | None,
        typer.Option(min=0.001, max=MOST_S, metavar="SECONDS", help="Of a turn, of those that count late ones; 0.1 without it."),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="What those draw by that draw; one that is printed without it.")] = None,
    matches: Annotated[
        str | None, typer.Option(metavar="N,N,...", help="How many matches at once, of those that play many; each is measured.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=64, metavar="N", help="Of the pit, of those that open one; 1 without it.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure how fast the arena is on this machine."""
    benchmarks = _find()
    if not benchmarks:
        raise InputError("no benchmarks are installed; the arena's own are in its source: run `arena bench` in a checkout")
    chosen = sorted(benchmarks) if run_all else names or []
    for name in chosen:
        if name not in benchmarks:
            raise UnknownNameError("benchmark", name, benchmarks)
    if not chosen:
        rows = [(name, (benchmarks[name]().__doc__ or "").partition("\n")[0]) for name in sorted(benchmarks)]
        if as_json:
            print_json(dict(rows))
        else:
            print_table(("benchmark", "what it measures"), rows)
        return
    runs = {name: benchmarks[name]() for name in chosen}
    options = {"minutes": minutes, "turn_time": turn_time, "seed": seed, "matches": matches, "workers": workers}
    given = {option: value for option, value in options.items() if value is not None}
    taken = {name: signature(run).parameters.keys() & given for name, run in runs.items()}
    for option in given:
        if not any(option in its for its in taken.values()):
            raise InputError(f"{_FOR_THOSE[option]}; {', '.join(chosen)} do not")
    results = {}
    for name, run in runs.items():
        with _progress(name) as progress:
            results[name] = run(progress, **{option: given[option] for option in taken[name]})
    if as_json:
        print_json(results)
    else:
        print_table(("figure", "value"), _flatten(results))
    broken = [f"{name} broke a promise: {sentence}" for name, found in results.items() for sentence in found.get("broken", ())]
    if broken:
        raise ArenaError(*broken)


@contextmanager
def _progress(name: str) -> Iterator[Progress]:
    """Show what is being done: one changing line on a terminal, plain lines elsewhere; on stderr."""
    if not sys.stderr.isatty():
        yield lambda text: say(f"{name}: {text}", err=True)
        return
    from rich.console import Console

    with Console(stderr=True).status(name) as status:
        yield lambda text: status.update(f"{name}: {text}")


def _flatten(values: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[str, object]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, (*path, str(key)))
        else:
            yield " / ".join((*path, str(key))), value
