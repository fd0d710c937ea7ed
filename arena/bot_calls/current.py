"""The call of a bot that is under way in this process: in which match, for which team, at which tick.

Whoever calls a bot says so by `begin` and `end`. It costs a fraction of a microsecond, as the bot's observation takes dozens.
"""

from mmap import mmap
from pathlib import Path
from struct import Struct

from arena.game.types import Team

START, END, _NO_CALL = -1, -2, -3
"""Instead of a tick."""
_TICK = Struct("<i")
_MOST_BYTES = 1 << 10


class Place:
    """A seat of a match, as what is said of its bot names it."""

    __slots__ = ("data", "match", "team")

    def __init__(self, match: str, team: Team) -> None:
        self.match, self.team = match, team
        self.data = self._words().encode("utf-8", "replace")[: _MOST_BYTES - _TICK.size - 1] + b"\0"

    def mark(self, tick: int) -> str:
        """Return what stands before a line that the bot prints."""
        return f"[{self.match} {self.team.name.lower()} {_moment(tick)}] "

    def describe(self, tick: int) -> str:
        """Return in words where the bot is."""
        return _moment(tick) + self._words()

    def _words(self) -> str:
        return f" of match {self.match} as {self.team.name.lower()}"


def _moment(tick: int) -> str:
    return {START: "the start", END: "the end"}.get(tick, f"tick {tick}")


_current: tuple[Place, int] | None = None
_shared: mmap | None = None
"""The same, where another process can read it."""


def begin(place: Place, tick: int) -> None:
    """Note that a bot is called: at a tick, at the START of its match or at the END."""
    global _current  # noqa: PLW0603 - a process calls one bot at a time
    _current = place, tick
    if _shared is not None:
        _TICK.pack_into(_shared, 0, tick)
        _shared[_TICK.size : _TICK.size + len(place.data)] = place.data


def end() -> None:
    """Note that the bot has answered."""
    global _current  # noqa: PLW0603 - as in `begin`
    _current = None
    if _shared is not None:
        _TICK.pack_into(_shared, 0, _NO_CALL)


def current() -> tuple[Place, int] | None:
    """Return the seat whose bot is called now, and at which tick."""
    return _current


def share(path: Path) -> None:
    """Let other processes read in a file which call is under way."""
    global _shared  # noqa: PLW0603 - the call of a process
    path.write_bytes(_TICK.pack(_NO_CALL).ljust(_MOST_BYTES, b"\0"))
    with path.open("r+b") as file:
        _shared = mmap(file.fileno(), _MOST_BYTES)


def read_shared(path: Path) -> str | None:
    """Return in words where the bot of another process is; None if none is called. `OSError` if there is no such file."""
    data = path.read_bytes()
    (tick,) = _TICK.unpack_from(data)
    if tick == _NO_CALL:
        return None
    return _moment(tick) + data[_TICK.size :].partition(b"\0")[0].decode("utf-8", "replace")
