"""How the `arena` command finds its sub-commands and ends; and `arena rules`.

A sub-command is a function, or a `typer.Typer` for a group of commands, whose docstring's first line is its help. Our own are
composed in `tournaments.cli`; other people's packages add theirs by the entry-point group `arena.commands`. Whoever writes one
may rely on this:

- its module imports no more than `typer` and `arena.console` when it is imported; heavy imports stand inside the function, so
  that `arena --help` stays quick;
- an `ArenaError` that it raises ends the command: one sentence on stderr, and the error's own exit code;
- a `KeyboardInterrupt` ends the command with exit code 130, and its notes are said;
- tables go out by `arena.console.print_table`, and with `--json` the same values by `print_json`; lines go out by `say`.
  All three clean what they print, so that no text of a stranger's reaches the terminal raw.
"""

import os
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points, version
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from arena.console import AsJson, complete_ruleset, print_json, print_table, say, say_lines, set_up_logging
from arena.errors import ArenaError, InputError, UnknownNameError

if TYPE_CHECKING:
    from arena.game.ruleset import Ruleset

Command = Callable[..., None] | typer.Typer
GROUP = "arena.commands"
"""Entry points of other people's commands."""


def make_app(commands: Mapping[str, Command]) -> typer.Typer:
    """Return the `arena` command with these sub-commands, and those of installed plug-ins."""

    class Commands(TyperGroup):
        """Plug-ins are imported when they are asked for; a broken one breaks itself alone."""

        def list_commands(self, ctx: Any) -> list[str]:
            return sorted({*commands, *plug_ins(GROUP)})

        def get_command(self, ctx: Any, cmd_name: str) -> Any:
            points = plug_ins(GROUP)
            if cmd_name in points:
                return _to_click(cmd_name, _load(points[cmd_name]))
            if cmd_name in commands:
                return _to_click(cmd_name, commands[cmd_name])
            if ctx.resilient_parsing:
                return None
            raise UnknownNameError("command", cmd_name, {*commands, *points})

        def invoke(self, ctx: Any) -> Any:
            try:
                return super().invoke(ctx)
            except KeyboardInterrupt as error:
                for note in getattr(error, "__notes__", ()):  # where each bot is
                    say_lines(note, err=True)
                raise

    app = typer.Typer(
        cls=Commands,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(arena)
    return app


def run(app: typer.Typer) -> None:
    """Run the command, and turn what went wrong into one sentence and an exit code."""
    try:
        app(prog_name="arena")
    except ArenaError as error:
        first, *others = map(str, error.args)
        say(f"arena: {first}", *others, err=True, level="error")
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)


def plug_ins(group: str) -> dict[str, EntryPoint]:
    """Return the installed entry points of a group, by name."""
    return {point.name: point for point in entry_points(group=group)}


def _load(point: EntryPoint) -> Command:
    try:
        command: Command = point.load()
    except Exception as error:  # noqa: BLE001 - a stranger's module may raise anything
        return _broken(point, error)
    return command


def _to_click(name: str, command: Command) -> Any:
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


def _print_version(wanted: bool) -> None:
    if wanted:
        say(f"arena {version('arena-pit')}")
        raise typer.Exit


def arena(
    verbose: Annotated[int, typer.Option("--verbose", "-v", count=True, help="Log matches; twice, log ticks.")] = 0,
    log_format: Annotated[
        str, typer.Option(envvar="ARENA_LOG", metavar="text|json", help="How to log; json is an object a line, with its matches.")
    ] = "text",
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    """Let algorithms play Capture-the-Flag in the fog."""
    if log_format not in ("text", "json"):
        raise InputError(f"--log-format, or ARENA_LOG, is {log_format!r}; it must be text or json")
    if log_format == "json":
        os.environ["ARENA_LOG"] = log_format  # for all that this command starts
    set_up_logging(verbose, log_format)


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
        say_lines(_toml(facts[0]))
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


def _toml(facts: Mapping[str, Any]) -> str:
    """Return a file that `arena.game.ruleset.load` reads back to the same rules."""
    import tomli_w

    title = ": ".join(filter(None, (facts["name"], facts["about"])))
    head = f"# {title}\n# hash {facts['hash']}\n# each key is explained in docs/reference/rules.md\n\n"
    return head + tomli_w.dumps(facts["rules"], multiline_strings=True)
