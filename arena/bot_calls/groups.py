"""The process groups that bots of this process have started, for whoever must end them if this process is killed."""

import os
import signal
from contextlib import suppress
from pathlib import Path

_folder: Path | None = None


def share_groups(folder: str) -> None:
    """Let another process see, by files in a folder, which groups there are."""
    global _folder  # noqa: PLW0603 - the folder of a process
    _folder = Path(folder)


def note(group: int) -> None:
    """Note that a group has started."""
    if _folder is not None:
        (_folder / f"group.{group}").touch()


def forget(group: int) -> None:
    """Note that a group has ended."""
    if _folder is not None:
        (_folder / f"group.{group}").unlink(missing_ok=True)


def end_noted() -> None:
    """End the groups that were noted in this process' folder: it is about to end, and nobody else is left to do it."""
    if _folder is not None:
        end_groups(str(_folder))


def end_groups(folder: str) -> None:
    """End the groups of processes that have ended."""
    for path in Path(folder).glob("group.*"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(int(path.suffix[1:]), signal.SIGKILL)
