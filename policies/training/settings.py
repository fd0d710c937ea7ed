"""Settings of any method: read from what a user wrote or a run's folder holds."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from arena.errors import InputError, UnknownNameError

Kind = TypeVar("Kind")
MOST_SEED = 2**32 - 1


def read_kept(path: Path, missing: str) -> dict[str, Any]:
    """Return what a folder of training says of itself: an object of JSON, whose `settings` are one, too.

    Raises
    ------
    InputError
        There is no file, which `missing` says, or something else is in it.
    """
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(missing) from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {error}") from error
    if not isinstance(kept, dict) or not isinstance(kept.get("settings"), dict):
        raise InputError(f"cannot read {path}: it is not as it was written; choose another folder")
    return kept


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


def check_range(
    settings: object, name: str, low: float, high: float = math.inf, *, above: bool = False, below: bool = False
) -> None:
    """Refuse a number of some settings that is none, or lies outside of a range.

    Parameters
    ----------
    above, below
        Whether the number must differ from `low`, and from `high`.

    Raises
    ------
    InputError
        It does.
    """
    value = getattr(settings, name)
    is_high_enough = low < value if above else low <= value
    is_low_enough = value < high if below else value <= high
    if not (is_high_enough and is_low_enough):  # so written, what is not a number is refused, too
        if isinstance(value, int):
            wanted = f"at least {low:,}" if value < low else f"at most {high:,}"
        elif math.isinf(high):
            wanted = (f"above {low:,}" if above else f"{low:,} or more") + (", and finite" if below else "")
        elif above or below:
            wanted = f"{'above' if above else 'at least'} {low:,} and {'below' if below else 'at most'} {high:,}"
        else:
            wanted = f"from {low:,} to {high:,}"
        raise InputError(f"the setting {name} is {value}; it must be {wanted}")


def check_shares(name: str, shares: Mapping[str, float]) -> None:
    """Refuse shares that are no numbers from 0 on, or all 0."""
    for one, share in shares.items():
        if not 0 <= share < math.inf:
            raise InputError(f"the setting {name}.{one} is {share}; it must be a share, which is a number from 0 on")
    if not any(shares.values()):
        raise InputError(f"the setting {name} must give each a share, and one of them more than 0")


def merge_shares(name: str, old: Mapping[str, float], new: Any) -> dict[str, float]:
    """Return the shares of a setting, where a user named some anew; who is given 0 is left out.

    Raises
    ------
    InputError
        What the user wrote are no shares.
    """
    if not isinstance(new, dict) or not all(type(share) in (int, float) for share in new.values()):
        raise InputError(f"the setting {name} is {new!r}; it takes shares by name, as in {name}.NAME=0.1")
    return {one: float(share) for one, share in {**old, **new}.items() if share}
