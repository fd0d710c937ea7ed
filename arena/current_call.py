"""Which bot this process is asking, in which match and at which tick: for what the bot prints, and for whoever interrupts it.

Whoever asks a bot says so by `begin` and `end`. It costs a fraction of a microsecond, as the bot's observation takes dozens.
"""

import faulthandler
import linecache
import os
import re
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from mmap import mmap
from pathlib import Path
from struct import Struct
from typing import Any, TextIO, cast

from arena.console import clean
from arena.game.types import Team

OURS: set[str] = set()
"""Files of ours that call bots; the frames within are the bots' own. Each adds itself."""
SIGNAL = signal.SIGUSR1
"""Has a process that is watched write its stack."""
_FRAME = re.compile(r'^ *File "(.*)", line (\d+) in (.*)$', re.MULTILINE)
_MOST_FRAMES = 5
START, END, _NOT_ASKED = -1, -2, -3
_TICK = Struct("<i")
_MOST_BYTES = 1 << 10
_PATIENCE_S, _LOOK_S = 1.0, 0.02


class Place:
    """A seat of a match, as what is told of its bot names it."""

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


_asked: tuple[Place, int] | None = None
"""The bot that is asked now, and at which tick."""
_shared: mmap | None = None
"""The same, where another process can read it."""
_folder: Path | None = None
"""Where that one looks."""


def begin(place: Place, tick: int) -> None:
    """A bot is asked: at a tick, at the START of its match or at the END."""
    global _asked  # noqa: PLW0603 - a process asks one bot at a time
    _asked = place, tick
    if _shared is not None:
        _TICK.pack_into(_shared, 0, tick)
        _shared[_TICK.size : _TICK.size + len(place.data)] = place.data


def end() -> None:
    """The bot has answered."""
    global _asked  # noqa: PLW0603 - as in `begin`
    _asked = None
    if _shared is not None:
        _TICK.pack_into(_shared, 0, _NOT_ASKED)


def explain(error: BaseException) -> None:
    """Note on an interrupt that was raised within a bot where that bot is."""
    if _asked is not None:
        place, tick = _asked
        frames = [(frame.filename, frame.lineno or 0, frame.name) for frame in traceback.extract_tb(error.__traceback__)]
        error.add_note(tell(place.describe(tick), frames[::-1]))


def tell(place: str, frames: Iterable[tuple[str, int, str]]) -> str:
    """Return in a line or a few where a bot is.

    Parameters
    ----------
    frames
        The stack of the process that asks it, innermost first: file, line and function. Without any of the bot's own, as those of
        a program, it is only said what was asked.
    """
    own: list[tuple[str, int, str]] = []
    for frame in frames:
        if frame[0] in OURS:
            break
        if frame[0] == __file__ and not own:  # it prints
            continue
        own.append(frame)
    if not own:
        return f"a bot was asked at {place}, and has not answered"
    outer, *inner = own[::-1]
    lines = [f"{Path(outer[0]).name} is at {place}: {_line(*outer)}"]
    if len(inner) > _MOST_FRAMES:
        lines.append("    ...")
    lines += [f"    {Path(frame[0]).name}, {_line(*frame)}" for frame in inner[-_MOST_FRAMES:]]
    return "\n".join(lines)


def _line(file: str, number: int, function: str) -> str:
    source = linecache.getline(file, number).strip()
    return f"line {number} in {function}{f': {source}' if source else ''}"


def be_watched(folder: str) -> None:
    """Let another process see, by files in a folder, where the bots of this one are; its main thread asks them."""
    global _folder, _shared  # noqa: PLW0603 - the place of a process
    _folder = Path(folder)
    path = _folder / str(os.getpid())
    path.write_bytes(_TICK.pack(_NOT_ASKED).ljust(_MOST_BYTES, b"\0"))
    with path.open("r+b") as file:
        _shared = mmap(file.fileno(), _MOST_BYTES)
    faulthandler.register(SIGNAL, path.with_suffix(".stack").open("wb"), all_threads=False)


def look(folder: str, pids: Iterable[int]) -> Iterator[str]:
    """Yield where the bots of watched processes are, even of those that loop in compiled code."""
    for pid in pids:
        path = Path(folder) / str(pid)
        with suppress(OSError):
            data = path.read_bytes()
            (tick,) = _TICK.unpack_from(data)
            if tick != _NOT_ASKED:
                place = _moment(tick) + data[_TICK.size :].partition(b"\0")[0].decode("utf-8", "replace")
                os.kill(pid, SIGNAL)
                yield tell(place, await_stack(path.with_suffix(".stack").read_bytes))


def note_group(group: int) -> None:
    """Tell whoever watches this process, if any, of a process group that it has started."""
    if _folder is not None:
        (_folder / f"group.{group}").touch()


def forget_group(group: int) -> None:
    """Take back what `note_group` told: the group has ended."""
    if _folder is not None:
        (_folder / f"group.{group}").unlink(missing_ok=True)


def end_groups(folder: str) -> None:
    """End the process groups that watched processes have left behind."""
    for path in Path(folder).glob("group.*"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(int(path.suffix[1:]), signal.SIGKILL)


def await_stack(read: Callable[[], bytes]) -> list[tuple[str, int, str]]:
    """Return the frames that `faulthandler` writes, innermost first, once nothing more is written; none if it writes nothing."""
    data, give_up_at = b"", time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up_at:
        time.sleep(_LOOK_S)
        before, data = data, read()
        if data and data == before:
            break
    return [(file, int(line), function) for file, line, function in _FRAME.findall(data.decode("utf-8", "replace"))]


@contextmanager
def marked_prints() -> Iterator[None]:
    """Put match, team and tick before each line that a bot prints, to stdout or stderr; all goes to stderr."""
    before = sys.stdout, sys.stderr
    sys.stdout = sys.stderr = cast("TextIO", _MarkedStream(sys.stderr))
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
        asked = _asked
        pieces = []
        if self._open is not None and asked != self._open:
            pieces.append("\n")
            self._open = None
        if asked is None:
            pieces.append(text)
        else:
            place, tick = asked
            for number, line in enumerate(text.split("\n")):
                if number > 0:
                    pieces.append("\n")
                    self._open = None
                if line:
                    pieces.append(("" if self._open else place.mark(tick)) + clean(line.rstrip("\r").expandtabs()))
                    self._open = asked
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
