"""Folders that are made if need be, and where data lives when nobody says."""

from pathlib import Path

from arena.errors import InputError


def make_folder(folder: Path, refusal: str, mode: int = 0o777) -> None:
    """Make a folder, unless it is there; `InputError`, which begins with `refusal`, if it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=mode)
    except FileExistsError as error:
        raise InputError(f"{refusal}: it is no folder") from error
    except OSError as error:
        raise InputError(f"{refusal}: {error.strerror}") from error


def data_folder(chosen: Path | None, mode: int = 0o777) -> Path:
    """Return a folder for journals, reports or results, made if need be; `InputError` if it cannot be."""
    from platformdirs import user_data_path

    folder = chosen if chosen is not None else user_data_path("arena")
    make_folder(folder, f"cannot use {folder} for data", mode)
    return folder
