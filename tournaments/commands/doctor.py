"""`arena doctor`: whether this machine is fit to play, whether a pit answers, and whether the machines of a cluster are alike."""

from typing import Annotated

import typer

from arena.console import AsJson, print_json, print_table
from clients.commands.connecting import Authority


def doctor(
    pit: Annotated[str, typer.Option(metavar="ADDRESS", help="Also ask whether this pit answers.")] = "",
    authority: Authority = None,
    cluster: Annotated[
        bool, typer.Option("--cluster", help="Also ask each machine of the Ray cluster that RAY_ADDRESS names.")
    ] = False,
    compile_: Annotated[
        bool, typer.Option("--compile", help="Compile the rules and all fighters first, as far as they are not.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Check that this machine can run the arena, that a pit answers, and that a cluster can; exit 1 if something is amiss."""
    from arena.extras import needs
    from clients.doctor import compile_all, examine

    if cluster:
        with needs("cluster", "--cluster"):
            from tournaments.venues.ray import examine_machines

    if compile_:
        compile_all()
    findings = [*examine(pit, authority), *(examine_machines() if cluster else ())]
    if as_json:
        print_json([{"what": what, "ok": is_ok, "finding": finding} for what, is_ok, finding in findings])
    else:
        print_table(("what", "ok", "finding"), findings)
    if not all(is_ok for _, is_ok, _ in findings):
        raise typer.Exit(1)
