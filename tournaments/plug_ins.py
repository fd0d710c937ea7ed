"""What other people's packages bring, by entry points, beside our own: ladders, rating methods."""

from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import TypeVar

from arena.errors import InputError, UnknownNameError

T = TypeVar("T")


def find_plug_in(group: str, what: str, own: Mapping[str, T], name: str) -> T:
    """Return what is called `name`: an entry point of the group, or one of our own.

    Raises
    ------
    InputError
        There is none of that name, or it cannot be loaded.
    """
    others = {point.name: point for point in entry_points(group=group)}
    if name not in {*own, *others}:
        raise UnknownNameError(what, name, {*own, *others})
    if name not in others:
        return own[name]
    try:
        found: T = others[name].load()
    except Exception as error:
        raise InputError(f"the {what} {name} cannot be loaded from {others[name].value}: {error!r}") from error
    return found
