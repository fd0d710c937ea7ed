"""Where data lives when nobody says."""

from pathlib import Path

from arena.errors import InputError


def data_folder(chosen: Path | None, mode: int = 0o777) -> Path:
    """Return a folder for journals, reports or results, made if need be; `InputError` if it cannot be."""
    from platformdirs import user_data_path

    folder = chosen if chosen is not None else user_data_path("arena")
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=mode)
    except FileExistsError as error:
        raise InputError(f"cannot use {folder} for data: it is no folder") from error
    except OSError as error:
        raise InputError(f"cannot use {folder} for data: {error.strerror}") from error
    return folder
