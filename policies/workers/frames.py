"""What a fighter's process and its owner say to each other: MessagePack, each message behind its length.

    to it    ["start", seat, {rules}, team, match, seconds, keeps, explains]
                                                            a match begins: its name, how long a turn may take, or null where no
                                                            clock runs, and `arena.policy.BatchPolicy`'s `keeps_annotations` and
                                                            `explains`
    to it    ["act", seat, observation]                     as `arena.protocol.observation_codec` packs it
    to it    ["end", seat, {"ending": ..., ...}]            the match is over
    from it  ["loaded"] or ["failed", why]                  once
    from it  [seat, orders, faults, annotations]            for each start, with b"" as orders, and for each act

A seat is a number of the owner's choice, and orders are a byte per unit. `faults` are the fields of `arena.policy.Faults`, since
the answer before; annotations are packed by `arena.annotations`.
"""

from typing import IO, Any

import msgpack

from arena.errors import UnreadableError

MOST_BYTES = 1 << 20
_LENGTH_BYTES = 4


def pack(message: list[Any]) -> bytes:
    """Return a message behind its length; halves of letters, which no bytes stand for and names of files have, are escaped."""
    data: bytes = msgpack.packb(message, unicode_errors="backslashreplace")
    return len(data).to_bytes(_LENGTH_BYTES, "little") + data


class FrameBuffer:
    """Takes bytes as they come, and gives messages."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, data: bytes) -> list[list[Any]]:
        """Take bytes, and return the messages that are whole now; `UnreadableError` if they are none."""
        self._data += data
        messages = []
        while len(self._data) >= _LENGTH_BYTES:
            length = int.from_bytes(self._data[:_LENGTH_BYTES], "little")
            if length > MOST_BYTES:
                raise UnreadableError(f"a message has {length} bytes")
            end = _LENGTH_BYTES + length
            if len(self._data) < end:
                break
            messages.append(_unpack(bytes(self._data[_LENGTH_BYTES:end])))
            del self._data[:end]
        return messages


def read_frame(stream: IO[bytes]) -> list[Any] | None:
    """Return the next message of a stream; None at its end."""
    length = stream.read(_LENGTH_BYTES)
    if len(length) < _LENGTH_BYTES:
        return None
    data = stream.read(int.from_bytes(length, "little"))
    return _unpack(data)


def _unpack(data: bytes) -> list[Any]:
    try:
        message = msgpack.unpackb(data)
    except Exception as error:  # msgpack raises several kinds, and a stranger chooses which
        raise UnreadableError("not MessagePack") from error
    if not isinstance(message, list) or not message:
        raise UnreadableError("no message")
    return message
