"""`arena admin`: the operator's commands to a running pit."""

from pathlib import Path
from typing import Annotated

import typer

from arena.console import say
from clients.commands.connecting import Authority

admin = typer.Typer(no_args_is_help=True, help="Tell a running pit what to do, with the key in its data folder.")
_Pit = Annotated[str, typer.Option("--pit", metavar="ADDRESS", help="Of the pit.")]
_Data = Annotated[Path | None, typer.Option("--data", metavar="DIR", help="The pit's own; your data folder without it.")]


@admin.command("kick")
def kick(
    target: Annotated[str, typer.Argument(metavar="NAME|KEY")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """Have an entry forfeit what it plays, and send it away; it may come back."""
    _send("kick", target, pit, data, authority)


@admin.command("ban")
def ban(
    target: Annotated[str, typer.Argument(metavar="NAME|KEY")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """Kick an entry, and never let its key in again."""
    _send("ban", target, pit, data, authority)


@admin.command("close")
def close(pit: _Pit = "", data: _Data = None, authority: Authority = None) -> None:
    """Begin no more matches; the pit ends with the last that runs."""
    _send("close", "the pit", pit, data, authority)


@admin.command("abort")
def abort(
    match: Annotated[str, typer.Argument(metavar="MATCH")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """End a match as void."""
    _send("abort", match, pit, data, authority)


@admin.command("release-name")
def release_name(
    name: Annotated[str, typer.Argument(metavar="NAME")], pit: _Pit = "", data: _Data = None, authority: Authority = None
) -> None:
    """Give a name back, for another key to take."""
    _send("release-name", name, pit, data, authority)


def _send(command: str, target: str, pit: str, data: Path | None, authority: Path | None) -> None:
    from arena.folders import data_folder
    from arena.keyring.files import load
    from arena.network.address import Address, parse_address
    from clients.admin import send_command

    address = parse_address(pit) if pit else Address()
    key = load(data_folder(data) / "keys" / "pit.key")
    say(send_command(address, authority, key, command, target))
