"""Messages to bytes and back: msgpack, an array of the version, the kind and the fields. Nothing else makes bytes messages."""

from collections.abc import Callable
from dataclasses import fields
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import msgpack

from arena.errors import UnreadableError, VersionError
from arena.protocol.messages import LATER, PROTOCOL_VERSION, Message

MOST_BYTES = 60_000
"""No message is longer; what is longer is sent in pieces."""
MOST_LISTED = 150
"""Matches, and clients that wait, that a lobby names, to be no longer."""
_KINDS: tuple[type, ...] = get_args(Message)
_N_KINDS = len(_KINDS)
_pack = msgpack.Packer().pack
_NUMBERS: dict[type, int] = {kind: number for number, kind in enumerate(_KINDS)}


def encode(message: Message, version: int | None = None) -> bytes:
    """Return the bytes of a message; without `version`, of this version of the protocol."""
    kind: type = type(message)
    shape = _shape(kind)
    values = [PROTOCOL_VERSION if version is None else version, _NUMBERS[kind], *shape.read(message)]
    for default in shape.defaults:
        if values[-1] != default:
            break
        values.pop()
    return bytes(_pack(values))


def decode(data: bytes, version: int | None = None) -> Message:
    """Return the message that `encode` wrote.

    Raises
    ------
    UnreadableError
        The bytes are no message, or one of another version.
    """
    if len(data) > MOST_BYTES:
        raise UnreadableError(f"{len(data)} bytes; no message is longer than {MOST_BYTES}")
    try:
        values = msgpack.unpackb(data)
    except (ValueError, msgpack.UnpackException, RecursionError) as error:
        raise UnreadableError("the bytes are not msgpack") from error
    if type(values) is not list or len(values) < 2 or type(values[0]) is not int or type(values[1]) is not int:
        raise UnreadableError("the bytes are no message of the arena")
    theirs, number, *rest = values
    ours = PROTOCOL_VERSION if version is None else version
    if theirs != ours:
        raise VersionError(f"the other side speaks version {theirs} of the protocol; this is version {ours}")
    if not 0 <= number < _N_KINDS:
        raise UnreadableError(f"there is no message of kind {number}")
    kind = _KINDS[number]
    shape = _shape(kind)
    if (*map(type, rest),) != shape.hints:  # those of every turn have nothing but plain types
        _check(kind, shape, rest)
    message: Message = kind(**dict(zip(shape.names, rest, strict=False)))
    return message


class _Shape(NamedTuple):
    """The fields of a kind of message, in their order."""

    names: tuple[str, ...]
    hints: tuple[Any, ...]
    defaults: tuple[Any, ...]
    """Of the fields that came later, the last first: those at their defaults are left out."""
    read: Callable[[Any], tuple[Any, ...]]
    """Returns the values of a message."""


@cache
def _shape(kind: Any) -> _Shape:
    known, hints = fields(kind), get_type_hints(kind)
    names = tuple(item.name for item in known)
    defaults = tuple(item.default for item in reversed(known) if item.metadata == LATER)
    read = attrgetter(*names) if len(names) > 1 else lambda message: tuple(getattr(message, name) for name in names)
    return _Shape(names, tuple(hints[name] for name in names), defaults, read)


def _check(kind: type, shape: _Shape, values: list[Any]) -> None:
    """Refuse values that are not those of a kind's fields."""
    if not len(shape.names) - len(shape.defaults) <= len(values) <= len(shape.names):
        raise UnreadableError(f"{kind.__name__} has {len(shape.names)} fields, not {len(values)}")
    for value, name, hint in zip(values, shape.names, shape.hints, strict=False):
        if type(value) is not hint and not _fits(value, hint):
            raise UnreadableError(f"{kind.__name__}.{name} is of another type than it should be")


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value read from msgpack is of an annotated type."""
    if hint is Any:
        return True
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is list:
        if type(value) is not list:
            return False
        return set(map(type, value)) <= {arguments[0]} or all(_fits(item, arguments[0]) for item in value)
    if origin is dict:
        return type(value) is dict and all(_fits(key, arguments[0]) and _fits(item, arguments[1]) for key, item in value.items())
    if arguments:  # a union
        return any(_fits(value, one) for one in arguments)
    return type(value) is hint or (hint is float and type(value) is int)
