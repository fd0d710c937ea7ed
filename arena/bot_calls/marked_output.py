"""What bots print, each line with its match, team and tick before it."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from arena.bot_calls.current import Place, current
from arena.console import clean


@contextmanager
def marked_prints() -> Iterator[None]:
    """Put match, team and tick before each line that a bot prints, to stdout or stderr; all goes to stderr."""
    before = sys.stdout, sys.stderr
    mark_prints()
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def mark_prints() -> None:
    """Do as `marked_prints`, for good."""
    sys.stdout = sys.stderr = cast("TextIO", _MarkedStream(sys.stderr))


class _MarkedStream:
    """A text stream; what nobody's bot writes passes through it as it is."""

    def __init__(self, under: TextIO) -> None:
        self._under = under
        self._open: tuple[Place, int] | None = None
        """Who began a line, and has not ended it."""

    @property
    def buffer(self) -> "_MarkedBytes":
        """The stream for who writes bytes."""
        return _MarkedBytes(self)

    def write(self, text: str) -> int:
        called = current()
        pieces = []
        if self._open is not None and called != self._open:
            pieces.append("\n")
            self._open = None
        if called is None:
            pieces.append(text)
        else:
            place, tick = called
            for number, line in enumerate(text.split("\n")):
                if number > 0:
                    pieces.append("\n")
                    self._open = None
                if line:
                    pieces.append(("" if self._open else place.mark(tick)) + clean(line.rstrip("\r").expandtabs()))
                    self._open = called
        self._under.write("".join(pieces))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._under, name)


class _MarkedBytes:
    def __init__(self, stream: _MarkedStream) -> None:
        self._stream = stream

    def write(self, data: bytes) -> int:
        self._stream.write(bytes(data).decode("utf-8", "replace"))
        return len(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
