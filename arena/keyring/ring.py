"""Where the keys of entries are: `keys/NAME.key` in the user's configuration folder, or in $ARENA_CONFIG."""

import os
from pathlib import Path

from arena.errors import InputError, KeyFileError
from arena.keyring.files import load
from arena.protocol.identity import Identity
from arena.protocol.topics import check_chunk

KEY_SUFFIX = ".key"


def config_folder() -> Path:
    """Return the folder for keys and known pits, which may not be there yet."""
    from platformdirs import user_config_path

    chosen = os.environ.get("ARENA_CONFIG")
    return Path(chosen) if chosen else user_config_path("arena")


def keys_folder() -> Path:
    """Return the folder of the entries' keys."""
    return config_folder() / "keys"


def entry_key_path(name: str) -> Path:
    """Return where an entry's key is, or would be; `InputError` if the name is none."""
    return keys_folder() / (check_chunk("the entry's name", name) + KEY_SUFFIX)


def entry_names() -> list[str]:
    """Return the names of the entries that have a key file, whatever it holds."""
    try:
        names = [path.stem for path in keys_folder().iterdir() if path.suffix == KEY_SUFFIX]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise KeyFileError(f"cannot list the keys in {keys_folder()}: {error.strerror}; mend the folder") from error
    return sorted(name.encode("utf-8", "replace").decode() for name in names)  # a file's name may be no text


def list_entries() -> list[tuple[str, Identity | str]]:
    """Return each entry's name, and its key or a sentence that says what is wrong with it."""
    return [(name, _load(name)) for name in entry_names()]


def _load(name: str) -> Identity | str:
    try:
        return load(entry_key_path(name))
    except InputError as error:
        return str(error)
