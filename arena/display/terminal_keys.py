"""Keys from a terminal: what it sends for each, and the mode in which it sends them at once."""

import os
import re
import signal
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

_NAMED = {
    b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left", b"\x1b[H": "home", b"\x1b[F": "end",
    b"\x1bOA": "up", b"\x1bOB": "down", b"\x1bOC": "right", b"\x1bOD": "left", b"\x1bOH": "home", b"\x1bOF": "end",
    b"\x1b[1~": "home", b"\x1b[4~": "end", b"\x1b[7~": "home", b"\x1b[8~": "end", b" ": "space",
}  # fmt: skip
"""Of what xterm, the Linux console, rxvt and tmux send; any other key of theirs has no name here, and is dropped."""
_SEQUENCE = re.compile(rb"\x1b\[[0-9;?]*[@-~]|\x1bO[@-~]|[^\x1b]", re.DOTALL)
_BEGUN = re.compile(rb"\x1b(?:\[[0-9;?]*|O)?\Z")


class KeyReader:
    """Makes keys of bytes, in pieces as they come: a sequence may be cut in two."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """Return the keys of what came: a letter as itself, others by name, as `left`."""
        data = self._rest + data
        begun = _BEGUN.search(data)
        self._rest = begun[0] if begun else b""
        found = _SEQUENCE.findall(data.removesuffix(self._rest))
        return [key for key in map(_name, found) if key]


def _name(sent: bytes) -> str:
    letter = sent.decode("ascii", "ignore")
    return _NAMED.get(sent) or (letter if len(letter) == 1 and letter.isprintable() else "")


@contextmanager
def keys_at_once(descriptor: int) -> Iterator[int]:
    """Have a terminal send each key at once, unshown, until the end, however that comes.

    Yields a pipe's end that has bytes to read after a signal, as at each change of the terminal's size: whoever waits for keys waits
    for it too. The signal itself may be handed to another thread, and wakes nobody who waits in this one.

    Ctrl-C stays Ctrl-C. Ctrl-Z does nothing: a stopped program would leave the terminal as it is. SIGTERM and SIGHUP end the
    program by `SystemExit`, so that all is put back.
    """

    def leave(number: int, _: object) -> None:
        raise SystemExit(128 + number)

    before = termios.tcgetattr(descriptor)
    heard = dict.fromkeys((signal.SIGTERM, signal.SIGHUP), leave) | {signal.SIGWINCH: lambda *_: None}
    reads, writes = os.pipe()
    os.set_blocking(writes, False)
    former_wakeup = signal.set_wakeup_fd(writes, warn_on_full_buffer=False)
    former = {number: signal.signal(number, handler) for number, handler in heard.items()}
    try:
        tty.setcbreak(descriptor)
        mode = termios.tcgetattr(descriptor)
        mode[tty.CC][termios.VSUSP] = bytes([os.fpathconf(descriptor, "PC_VDISABLE")])
        termios.tcsetattr(descriptor, termios.TCSADRAIN, mode)
        yield reads
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
        for number, handler in former.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(former_wakeup)
        os.close(reads)
        os.close(writes)
