"""Where data lives when nobody says."""

from pathlib import Path

from arena.errors import InputError


def data_folder(chosen: Path | None) -> Path:
    """Return the folder for journals, reports and results, made if need be."""
    from platformdirs import user_data_path

    folder = chosen if chosen is not None else user_data_path("arena")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot use {folder} for data: {error.strerror}") from error
    return folder
