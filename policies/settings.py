"""Settings behind a fighter's name, as in planner:budget=2000,hold=12."""

from collections.abc import Mapping

from arena.errors import PolicyError, UnknownNameError

Setting = int | float | bool
_WORDS = {"true": True, "false": False}


def read_settings(name: str, text: str, defaults: Mapping[str, Setting]) -> dict[str, Setting]:
    """Return the settings that a text spells, each of the type of its default.

    Raises
    ------
    UnknownNameError
        There is no such setting.
    PolicyError
        A value cannot be read.
    """
    settings: dict[str, Setting] = {}
    for part in text.split(","):
        key, _, value = part.partition("=")
        if key not in defaults:
            raise UnknownNameError(f"setting of {name}", key, sorted(defaults))
        settings[key] = _read(name, key, value, defaults[key])
    return settings


def _read(name: str, key: str, value: str, default: Setting) -> Setting:
    kind = type(default)
    try:
        read = _WORDS[value] if kind is bool else kind(value)
    except (KeyError, ValueError):
        read = -1
    if not (kind is int) <= read < 1 << 31:
        wanted = {bool: "true or false", int: "a whole number from 1 on", float: "a number from 0 on"}[kind]
        raise PolicyError(f"{name}: {key} is {value!r}; it must be {wanted}, as in {key}={str(default).lower()}")
    return read
