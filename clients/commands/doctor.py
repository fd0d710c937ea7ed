"""`arena doctor`: whether this machine is fit to play, and whether a pit answers."""

from typing import Annotated

import typer

from arena.console import AsJson, print_json, print_table
from clients.commands.connecting import Authority


def doctor(
    pit: Annotated[str, typer.Option(metavar="ADDRESS", help="Also ask whether this pit answers.")] = "",
    authority: Authority = None,
    compile_: Annotated[
        bool, typer.Option("--compile", help="Compile the rules and all fighters first, as far as they are not.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Check that this machine can run the arena, and that a pit answers; exit 1 if something is amiss."""
    from clients.doctor import compile_all, examine

    if compile_:
        compile_all()
    findings = examine(pit, authority)
    if as_json:
        print_json([{"what": what, "ok": is_ok, "finding": finding} for what, is_ok, finding in findings])
    else:
        print_table(("what", "ok", "finding"), findings)
    if not all(is_ok for _, is_ok, _ in findings):
        raise typer.Exit(1)
