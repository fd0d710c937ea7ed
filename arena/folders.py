"""Folders that are made if need be, that one process alone writes to, and where data lives when nobody says."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from arena.errors import InputError

_LOCK = ".lock"


def make_folder(folder: Path, refusal: str, mode: int = 0o777) -> None:
    """Make a folder, unless it is there; `InputError`, which begins with `refusal`, if it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=mode)
    except FileExistsError as error:
        raise InputError(f"{refusal}: it is no folder") from error
    except OSError as error:
        raise InputError(f"{refusal}: {error.strerror}") from error


@contextmanager
def hold_folder(folder: Path, doing: str) -> Iterator[None]:
    """Be the only process that does something in a folder, until `with` ends or the process dies.

    Raises
    ------
    InputError
        Another process does it, or nothing can be written there.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / _LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        raise InputError(f"another process is {doing} in {folder}; wait until it has ended, or choose another folder") from error
    except OSError as error:
        raise InputError(f"cannot write to {folder}: {error.strerror}") from error
    try:
        yield
    finally:
        lock.release()


def data_folder(chosen: Path | None, mode: int = 0o777) -> Path:
    """Return a folder for journals, reports or results, made if need be; `InputError` if it cannot be."""
    from platformdirs import user_data_path

    folder = chosen if chosen is not None else user_data_path("arena")
    make_folder(folder, f"cannot use {folder} for data", mode)
    return folder
