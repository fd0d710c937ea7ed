"""The `arena` command, and the sub-commands of the pit itself.

A sub-command is an entry point of the group `arena.commands`: its name, and a function (or a `typer.Typer`, for a
group of commands) whose docstring's first line is its help. Whoever writes one may rely on this:

- it stands in a module called `cli.py`, which imports no more than `typer` and `arena.console` when it is imported; heavy
  imports stand inside the function, so that `arena --help` stays quick;
- an `ArenaError` that it raises ends the command: one sentence on stderr, and the error's own exit code;
- tables go out by `arena.console.print_table`, and with `--json` the same facts by `print_json`.
"""

import json
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points, version
from inspect import signature
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from arena.console import AsJson, complete_ruleset, print_json, print_table
from arena.errors import ArenaError, InputError, UnknownNameError

if TYPE_CHECKING:
    from arena.game.ruleset import Ruleset


class _Commands(TyperGroup):
    """Sub-commands that are imported when they are asked for; a broken plugin breaks itself alone."""

    def list_commands(self, ctx: Any) -> list[str]:
        return sorted(_points("arena.commands"))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        points = _points("arena.commands")
        if cmd_name not in points:
            if ctx.resilient_parsing:
                return None
            raise UnknownNameError("command", cmd_name, points)
        try:
            return _to_click(cmd_name, points[cmd_name].load())
        except Exception as error:  # noqa: BLE001 - a stranger's module may raise anything
            return _to_click(cmd_name, _broken(points[cmd_name], error))


def _points(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=group)}


def _to_click(name: str, command: Callable[..., None] | typer.Typer) -> Any:
    if isinstance(command, typer.Typer):
        group = get_group(command)
        group.name = name
        return group
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.command(name)(command)
    return get_command(alone)


def _broken(point: EntryPoint, error: Exception) -> Callable[..., None]:
    sentence = f"the command {point.name} cannot be loaded from {point.value}: {error}"

    def broken() -> None:
        raise ArenaError(sentence)

    broken.__doc__ = f"(Cannot be loaded: {error})"
    return broken


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"arena {version('arena-pit')}")
        raise typer.Exit


@app.callback()
def arena(
    verbose: Annotated[int, typer.Option("--verbose", "-v", count=True, help="Log matches; twice, log ticks.")] = 0,
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    """Let algorithms play Capture-the-Flag in the fog."""
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    logging.basicConfig(level=level, format="%(asctime)s %(levelname)s %(name)s: %(message)s", stream=sys.stderr)


def main() -> None:
    """Run `arena`, and turn what went wrong into one sentence and an exit code."""
    try:
        app(prog_name="arena")
    except ArenaError as error:
        typer.echo(f"arena: {error}", err=True)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)


def rules(
    ruleset: Annotated[
        str, typer.Argument(metavar="NAME|FILE.toml", autocompletion=complete_ruleset, help="One ruleset; none lists all.")
    ] = "",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as in units.ugv.sight=5.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the rulesets, or show one as the TOML file that it could be."""
    from arena.game.ruleset import RULESETS, load, parse_overrides

    if not ruleset and settings:
        raise InputError("--set changes one ruleset; name it, as in: arena rules paper --set side=16")
    overrides = parse_overrides(settings or ())
    facts = [_facts(load(name).with_(overrides)) for name in ([ruleset] if ruleset else RULESETS)]
    if as_json:
        print_json(facts[0] if ruleset else facts)
    elif ruleset:
        typer.echo("\n".join(_toml(facts[0])))
    else:
        print_table(("name", "side", "blue", "red", "ticks", "fog", "combat", "about"), map(_row, facts))


def _facts(ruleset: "Ruleset") -> dict[str, Any]:
    from importlib.resources import files

    from arena.game.ruleset import RULESETS, to_dict

    about = ""
    if ruleset.name in RULESETS:
        text = (files("arena.game") / "rulesets" / f"{ruleset.name}.toml").read_text(encoding="utf-8")
        about = text.partition("\n")[0].removeprefix("#").strip()
    return {"name": ruleset.name, "about": about, "hash": ruleset.hash, "rules": to_dict(ruleset)}


def _row(facts: Mapping[str, Any]) -> list[object]:
    values = facts["rules"]
    blue, red = (
        " + ".join(f"{unit[team]} {name}" for name, unit in values["units"].items() if unit[team]) or "nobody"
        for team in ("blue", "red")
    )
    combat = "random" if values["random_combat"] else "certain"
    return [facts["name"], values["side"], blue, red, values["tick_limit"], values["fog"], combat, facts["about"]]


def _toml(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a file that `arena.game.ruleset.load` reads back to the same rules."""
    yield f"# {facts['name']}{': ' if facts['about'] else ''}{facts['about']}"
    yield f"# hash {facts['hash']}"
    yield ""
    tables = {(): facts["rules"]} | {("units", name): row for name, row in facts["rules"]["units"].items()}
    for path, values in tables.items():
        if path:
            yield f"\n[{'.'.join(json.dumps(key) if not key.isidentifier() else key for key in path)}]"
        for key, value in values.items():
            if not isinstance(value, Mapping):
                yield f"{key} = '''\n{value}'''" if key == "board" else f"{key} = {json.dumps(value)}"


Progress = Callable[[str], None]
"""Says in a few words what a benchmark is at."""
Benchmark = Callable[..., dict[str, Any]]
"""What the group `arena.benchmarks` names: is given its `Progress`, and returns numbers, nested under names as deep as it likes.

One that has a parameter `minutes` goes on for as long as it is told; what it does untold is short enough for `--all`.
"""


def complete_benchmark(incomplete: str) -> list[str]:
    """Return the names of benchmarks that begin like `incomplete`, for the shell."""
    return sorted(name for name in _points("arena.benchmarks") if name.startswith(incomplete))


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME...", autocompletion=complete_benchmark, help="Which to run; none lists them."),
    ] = None,
    run_all: Annotated[bool, typer.Option("--all", help="Run every one.")] = False,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, help="How long, of those that measure for as long as they are told.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure how fast the arena is on this machine."""
    points = _points("arena.benchmarks")
    chosen = sorted(points) if run_all else names or []
    for name in chosen:
        if name not in points:
            raise UnknownNameError("benchmark", name, points)
    if not chosen:
        rows = [(name, (points[name].load().__doc__ or "").partition("\n")[0]) for name in sorted(points)]
        if as_json:
            print_json(dict(rows))
        else:
            print_table(("benchmark", "what it measures"), rows)
        return
    runs = {name: points[name].load() for name in chosen}
    timed = [name for name, run in runs.items() if "minutes" in signature(run).parameters]
    if minutes is not None and not timed:
        raise InputError(f"--minutes is for benchmarks that measure for as long as they are told; {', '.join(chosen)} do not")
    results = {}
    for name, run in runs.items():
        options = {"minutes": minutes} if minutes is not None and name in timed else {}
        with _progress(name) as progress:
            results[name] = run(progress, **options)
    if as_json:
        print_json(results)
    else:
        print_table(("figure", "value"), _flatten(results))


@contextmanager
def _progress(name: str) -> Iterator[Progress]:
    """Show what is being done: one changing line on a terminal, plain lines elsewhere; on stderr."""
    if not sys.stderr.isatty():
        yield lambda text: typer.echo(f"{name}: {text}", err=True)
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
