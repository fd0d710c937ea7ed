"""Where a bot is, by the stack of the process that calls it: this one, or another."""

import faulthandler
import linecache
import logging
import os
import re
import signal
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from arena.bot_calls import marked_output
from arena.bot_calls.current import current, read_shared, share

logger = logging.getLogger(__name__)
OURS: set[str] = set()
"""Files of ours that call bots; the frames within are the bots' own. Each adds itself."""
SIGNAL = signal.SIGUSR1
"""Has a process write its stack."""
_FRAME = re.compile(r'^ *File "(.*)", line (\d+) in (.*)$', re.MULTILINE)
_MOST_FRAMES = 5
_PATIENCE_S, _LOOK_S = 1.0, 0.02


def add_stack(error: BaseException) -> None:
    """Note on an interrupt that was raised within a bot where that bot is."""
    called = current()
    if called is not None:
        place, tick = called
        frames = [(frame.filename, frame.lineno or 0, frame.name) for frame in traceback.extract_tb(error.__traceback__)]
        error.add_note(describe_stack(place.describe(tick), frames[::-1]))


def describe_stack(place: str, frames: Iterable[tuple[str, int, str]]) -> str:
    """Return in a line or a few where a bot is.

    Parameters
    ----------
    frames
        The stack of the process that calls it, innermost first: file, line and function. Without any frame of the bot's own, as
        where a program is asked, it is only said what was asked.
    """
    own: list[tuple[str, int, str]] = []
    for frame in frames:
        if frame[0] in OURS:
            break
        if frame[0] == marked_output.__file__ and not own:  # it prints
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


def share_stack(folder: str) -> None:
    """Let another process see, by files in a folder, where the bots of this one are; its main thread calls them."""
    path = Path(folder) / str(os.getpid())
    try:
        share(path)
        faulthandler.register(SIGNAL, path.with_suffix(".stack").open("wb"), all_threads=False)
    except OSError as error:  # a full disk: the bots play all the same
        logger.info("nobody can see where the bots of this process are: %s", error)
        path.unlink(missing_ok=True)


def describe_stacks(folder: str, pids: Iterable[int]) -> Iterator[str]:
    """Yield where the bots of processes are that share their stacks, even of those that loop in compiled code."""
    for pid in pids:
        path = Path(folder) / str(pid)
        with suppress(OSError):
            place = read_shared(path)
            if place is not None:
                os.kill(pid, SIGNAL)
                yield describe_stack(place, await_stack(path.with_suffix(".stack").read_bytes))


def await_stack(read: Callable[[], bytes]) -> list[tuple[str, int, str]]:
    """Return the frames that `faulthandler` writes, innermost first, once nothing more is written; none if it writes nothing."""
    data, give_up_at = b"", time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up_at:
        time.sleep(_LOOK_S)
        before, data = data, read()
        if data and data == before:
            break
    return [(file, int(line), function) for file, line, function in _FRAME.findall(data.decode("utf-8", "replace"))]
