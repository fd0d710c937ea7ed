"""The commands that keep a data folder safe: `arena backup` and `arena restore`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import say

if TYPE_CHECKING:
    from tournaments.backup import Copied

Data = Annotated[Path | None, typer.Option(metavar="DIR", help="The data folder; yours without it.")]
Db = Annotated[str, typer.Option(metavar="URL|FILE", help="The store of results; arena.db in the data folder without it.")]


def backup(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write; one that is there is left alone.")],
    data: Data = None,
    db: Db = "",
) -> None:
    """Write a whole data folder and its store into one file, while whatever uses them goes on.

    The file holds private keys and the secrets of leagues: it is made for your eyes alone, and should stay so.
    """
    from arena.folders import data_folder
    from tournaments.backup import back_up

    copied = back_up(file, data or data_folder(None), db)
    say(f"{file}: {_describe(copied)}")
    say("private keys are in it: whoever has the file can be the pit, and knows the secrets of its leagues")
    for path in copied.left_out:
        say(f"left out: {path}, which is neither a file nor a folder", err=True)


def restore(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `arena backup` wrote.")],
    data: Data = None,
    db: Db = "",
) -> None:
    """Lay out what `arena backup` wrote, in an empty folder and an empty store.

    The store may be of another kind than the one that was backed up: so results move from SQLite to PostgreSQL, and back.
    """
    from arena.folders import data_folder
    from tournaments.backup import restore as lay_out

    folder = data or data_folder(None)
    say(f"{folder}: {_describe(lay_out(file, folder, db))}")


def _describe(copied: "Copied") -> str:
    rows = "no store" if copied.n_rows is None else f"a store of {copied.n_rows:,} rows"
    return f"{copied.n_files:,} files and {rows}"
