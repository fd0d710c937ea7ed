"""Settings of any method: read from what a user wrote or a run's folder holds."""

from collections.abc import Mapping
from typing import Any, TypeVar, get_type_hints

from arena.errors import InputError, UnknownNameError

Kind = TypeVar("Kind")


def read_values(kind: type[Kind], values: Mapping[str, Any]) -> Kind:
    """Return the settings of a method, checked against its dataclass, whose fields all have defaults.

    Raises
    ------
    InputError
        A value is unknown, or of another type.
    """
    hints = get_type_hints(kind)
    checked = dict(values)
    for name, value in values.items():
        if name not in hints:
            raise UnknownNameError("setting", name, hints)
        wanted = hints[name]
        if wanted is float and type(value) is int:
            checked[name] = float(value)
        elif wanted in (int, float, str, bool) and type(value) is not wanted:
            expected = {str: "text", bool: "true or false"}.get(wanted, "a number")
            raise InputError(f"the setting {name} is {value!r}; it must be {expected}")
    return kind(**checked)
