"""Keys as terminals send them."""

import os
import pty
import select
import signal
import termios
from collections.abc import Iterator
from threading import Thread, get_ident

import pytest

from arena.display.terminal_keys import KeyReader, keys_at_once


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"q", ["q"]),
        (b" n?", ["space", "n", "?"]),
        (b"\x1b[C\x1b[D", ["right", "left"]),
        (b"\x1bOA\x1bOB", ["up", "down"]),
        (b"\x1b[H\x1b[F\x1b[1~\x1b[4~", ["home", "end", "home", "end"]),
        (b"\x1b[1;5C\x1b[15~v", ["v"]),
        (b"\x1b\x1bq", ["q"]),
        ("é\n\x00l".encode(), ["l"]),
    ],
)
def test_bytes_are_keys_however_they_are_cut(sent: bytes, keys: list[str]) -> None:
    whole, pieces = KeyReader(), KeyReader()

    assert whole.feed(sent) == keys
    assert [key for byte in sent for key in pieces.feed(bytes([byte]))] == keys


@pytest.fixture
def terminal() -> Iterator[int]:
    ours, theirs = pty.openpty()
    yield theirs
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_terminal_is_as_before_after_a_signal(terminal: int, number: signal.Signals) -> None:
    before, handler = termios.tcgetattr(terminal), signal.getsignal(number)

    def end_while_keys_are_read() -> None:
        with keys_at_once(terminal):
            assert not termios.tcgetattr(terminal)[3] & (termios.ICANON | termios.ECHO)
            signal.raise_signal(number)

    with pytest.raises(SystemExit) as left:
        end_while_keys_are_read()

    assert left.value.code == 128 + number
    assert termios.tcgetattr(terminal) == before
    assert signal.getsignal(number) is handler


def test_ctrl_c_is_heard_and_ctrl_z_is_not(terminal: int) -> None:
    with keys_at_once(terminal):
        mode = termios.tcgetattr(terminal)

    assert mode[3] & termios.ISIG
    assert mode[6][termios.VINTR] == b"\x03"
    assert mode[6][termios.VSUSP] == b"\0"


def test_a_new_size_wakes_who_waits_whichever_thread_gets_the_signal(terminal: int) -> None:
    with keys_at_once(terminal) as signalled:
        thread = Thread(target=lambda: signal.pthread_kill(get_ident(), signal.SIGWINCH))
        thread.start()
        woken = select.select([signalled], [], [], 60.0)[0]
        thread.join()

    assert woken == [signalled]
    assert signal.set_wakeup_fd(-1) == -1
