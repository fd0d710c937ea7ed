"""The owner's side of one fighter's process: it is started, told things and asked things, and never waited for.

A thread hears what it says, and tells it what it did not read at once: whoever asks it never waits for its pipe. What it prints
is passed on up to a bound; then it is read no more, and printing blocks.
"""

import logging
import os
import selectors
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock, Thread
from typing import Any

from arena.bot_calls import stacks
from arena.bot_calls.current import Place
from arena.console import clean
from arena.errors import UnreadableError
from arena.policy import Faults
from arena.sandbox.limits import Limits
from arena.sandbox.process import Sandbox, SandboxedProcess
from policies.workers.frames import FrameBuffer, pack

logger = logging.getLogger(__name__)
_CHUNK = 1 << 16
_MOST_LETTERS, _MOST_WORDS_LETTERS = 4_000, 400
_MOST_UNREAD_BYTES = 4 << 20
"""Of what it is told, beside what its pipe holds: the observations of many seats at once, and no more."""
_GOODBYE_S = 1.0
"""How long a process whose last match is over may take to end."""
_LOOK_S = 1.0
"""After so long without a word from it, it is looked whether it has met a limit, or has ended."""
_EXIT_S = 0.5
"""Between the end of what a process says and its own."""
_WORDS = {
    "memory_mb": "memory",
    "cpu_s": "processor time",
    "processes": "processes",
    "output_kb": "output",
}


class OutputLog:
    """Passes on what fighters print, up to a bound: to stderr, or to `take`."""

    def __init__(self, limits: Limits, take: Callable[[bytes], None] | None = None) -> None:
        self._take = take
        self._n_left = sys.maxsize if limits.output_kb is None else limits.output_kb << 10
        self._lock = Lock()

    def write(self, data: bytes) -> None:
        """Pass on what may be; the rest is thrown away."""
        with self._lock:
            before = self._n_left
            self._n_left -= len(data)
        if before > 0 and self._take is not None:
            self._take(data[:before])
        elif before > 0:
            with suppress(OSError, ValueError):  # our own stderr may be closed, or its disk full
                sys.stderr.write("\n".join(map(clean, data[:before].decode("utf-8", "replace").split("\n"))))
                sys.stderr.flush()


@dataclass(frozen=True, slots=True)
class Answer:
    """To a start, without orders; or to an observation."""

    orders: bytes
    """A byte for each unit."""
    faults: Faults
    """Since the answer before."""
    annotations: bytes


class Worker:
    """One process of a fighter.

    Parameters
    ----------
    on_change
        Called from another thread when it has said something, or ended.
    on_limit
        Called from another thread with the limit, in a word or two, when it has met one.
    """

    def __init__(
        self,
        spec: str,
        sandbox: Sandbox,
        environment: Mapping[str, str],
        *,
        log: OutputLog,
        on_change: Callable[[], None],
        on_limit: Callable[[str], None],
    ) -> None:
        self._process = SandboxedProcess([sys.executable, "-P", "-m", "policies.workers.child", spec], sandbox, environment)
        self._stdin, self._stdout, self._stderr = self._process.pipes
        self._limits, self._log, self._on_change, self._on_limit = sandbox.limits, log, on_change, on_limit
        os.set_blocking(self._stdin.fileno(), False)
        self._lock = Lock()
        self._unread = bytearray()
        """What its pipe could not take yet."""
        self._has_pipes = True
        """Whether our ends of the pipes are open: their numbers may be other files' afterwards."""
        self._n_owed = 0
        """Answers that it was asked for."""
        self._answers: dict[int, deque[Answer]] = {}
        self._n_printed = 0
        self._noted: set[str] = set()
        """Limits that were told of."""
        self._counted: deque[str] = deque()
        """What a league counts against it, and was not taken yet: the kind of each fault."""
        self._end_by_s: float | None = None
        self.is_loaded = False
        """Whether it can be asked."""
        self.failure: str | None = None
        """Why it answers no more, in a sentence."""
        self.asked: tuple[Place, int] | None = None
        """Where it is asked next, or was asked last."""
        self._dump: bytearray | None = None
        """What it writes to stderr from the moment on that it is to write its stack."""
        self._wake_read, self._wake_write = os.pipe()
        self._listener = Thread(target=self._listen, name=f"listens to {spec}", daemon=True)
        self._listener.start()

    def start(
        self, seat: int, rules: dict[str, Any], team: int, match: str, *, turn_time_s: float | None, keeps_annotations: bool,
        explains: bool,
    ) -> None:  # fmt: skip
        """Begin a match under a number that is new."""
        self._answers[seat] = deque()
        self._send(["start", seat, rules, team, match, turn_time_s, keeps_annotations, explains], n_answers=1)

    def ask(self, seat: int, observation: bytes) -> None:
        """Show a seat an observation."""
        self._send(["act", seat, observation], n_answers=1)

    def finish(self, seat: int, result: dict[str, Any]) -> None:
        """End a match."""
        self._answers.pop(seat, None)
        self._send(["end", seat, result])

    def has_answer(self, seat: int) -> bool:
        """Whether `take` need not wait: a seat has answered, or never will."""
        return self.failure is not None or bool(self._answers.get(seat))

    def take(self, seat: int) -> "Answer | None":
        """Return what a seat has answered to the oldest message that it was not taken of, if it has."""
        answers = self._answers.get(seat)
        return answers.popleft() if answers else None

    def take_counted(self) -> dict[str, int]:
        """Return what a league counts against it, by kind, since the last call: limits that it met, or no answer."""
        return Counter(self._counted.popleft() for _ in range(len(self._counted)))

    def memory_bytes(self) -> int | None:
        """Return what it holds in memory, with all that it started; None where the system does not tell."""
        return self._process.memory_bytes()

    def whereabouts(self) -> str | None:
        """Return where the fighter is, by its own stack, if it owes an answer; waits for that for a moment."""
        if self.asked is None or self._n_owed <= 0 or self.failure is not None:
            return None
        place, tick = self.asked
        dump = self._dump = bytearray()
        self._process.send_signal(stacks.SIGNAL)
        return stacks.describe_stack(place.describe(tick), stacks.await_stack(lambda: bytes(dump)))

    def _send(self, message: list[Any], n_answers: int = 0) -> None:
        """Tell it something; nothing comes of that if it has ended."""
        with self._lock:
            self._n_owed += n_answers
            self._unread += pack(message)
            self._flush()
            if not self._unread:
                return
            if len(self._unread) > _MOST_UNREAD_BYTES and self.failure is None:
                self.failure = "its process does not read what it is told"
                self._end_by_s = 0.0
        self._wake()

    def _flush(self) -> None:
        """Write what its pipe takes; under the lock."""
        try:
            n_written = self._stdin.write(self._unread) if self._has_pipes else len(self._unread)
        except (OSError, ValueError):
            logger.info("a fighter's process has ended, and is told nothing")
            n_written = len(self._unread)
        del self._unread[: n_written or 0]

    def dismiss(self) -> None:
        """Let it end by itself for a moment, and end it then; returns at once."""
        self._end_by_s = time.monotonic() + _GOODBYE_S
        self._wake()

    def kill(self, why: str = "it was told to end", counted: str = "") -> None:
        """End it now, and wait until it has ended; nothing is done if it has. A league may count why."""
        if counted and self.failure is None:
            self._counted.append(counted)
        self.failure = self.failure or why
        self._end_by_s = 0.0
        self._wake()
        self._listener.join()

    def _wake(self) -> None:
        """Have the listener look at the clock, and at what it has to tell."""
        with self._lock:
            if self._has_pipes:
                os.write(self._wake_write, b"!")

    def _listen(self) -> None:
        is_dismissed = False
        try:
            is_dismissed = self._hear_all()
        except UnreadableError as error:
            self.failure = f"its process wrote what is no answer: {error}"
        finally:
            self._finish(is_dismissed=is_dismissed)

    def _hear_all(self) -> bool:
        """Hear it until it ends or is to be ended; return whether it was dismissed."""
        frames = FrameBuffer()
        with selectors.DefaultSelector() as selector:
            for stream in (self._stdout, self._stderr, self._wake_read):
                selector.register(stream, selectors.EVENT_READ)
            while True:
                wait_s = _LOOK_S if self._end_by_s is None else max(self._end_by_s - time.monotonic(), 0.0)
                ready = [key.fileobj for key, _ in selector.select(wait_s)]
                if not ready:  # it is busy, or idle; who works asks for more
                    for name in self._process.limits_met_so_far():
                        self._note(name)
                    if not self._process.is_running:  # something that it started holds its pipe
                        return self._end_by_s is not None
                is_dismissed = self._end_by_s is not None
                if self._end_by_s is not None and time.monotonic() >= self._end_by_s:
                    return is_dismissed
                if self._wake_read in ready:
                    os.read(self._wake_read, _CHUNK)
                self._tell(selector, is_dismissed=is_dismissed)
                if self._stderr in ready:
                    self._hear_stderr(selector)
                if self._stdout in ready:
                    data = os.read(self._stdout.fileno(), _CHUNK)
                    if not data:
                        return is_dismissed
                    messages = frames.feed(data)
                    for message in messages:
                        self._hear(message)
                    if messages:
                        self._on_change()
                    if self.failure is not None:
                        return is_dismissed

    def _tell(self, selector: selectors.BaseSelector, *, is_dismissed: bool) -> None:
        """Write what it did not read at once, as far as its pipe takes it; say goodbye by closing the pipe."""
        with self._lock:
            if self._stdin.closed:
                return
            self._flush()
            is_registered = self._stdin in selector.get_map()
            if is_registered and not self._unread:
                selector.unregister(self._stdin)
            elif self._unread and not is_registered:
                selector.register(self._stdin, selectors.EVENT_WRITE)
            if is_dismissed and not self._unread:
                self._stdin.close()

    def _hear(self, message: list[Any]) -> None:
        """Take a message apart, in which a stranger may have written anything."""
        match message:
            case ["loaded"] if not self.is_loaded:
                self.is_loaded = True
            case ["failed", str(why)]:
                self.failure = why[:_MOST_LETTERS]
            case [int(seat), bytes(orders), list(told), bytes(annotations)]:
                faults = _read_faults(told)
                with self._lock:
                    self._n_owed -= 1
                    if self._n_owed < 0:
                        raise UnreadableError("more answers than questions")
                    answers = self._answers.get(seat)
                if answers is not None:  # else of a match that is over
                    answers.append(Answer(orders, faults, annotations))
            case _:
                raise UnreadableError("no message that it may write")

    def _hear_stderr(self, selector: selectors.BaseSelector) -> None:
        data = os.read(self._stderr.fileno(), _CHUNK)
        if not data:
            selector.unregister(self._stderr)
            return
        if self._dump is None:
            self._log.write(data)
        elif len(self._dump) < _CHUNK:
            self._dump += data
        self._n_printed += len(data)
        if self._limits.output_kb is not None and self._n_printed > self._limits.output_kb << 10:
            selector.unregister(self._stderr)  # from here on, whoever goes on printing waits for us
            self._note("output_kb")

    def _finish(self, *, is_dismissed: bool) -> None:
        with self._lock:
            self._stdin.close()
        code = self._process.end(0.0 if is_dismissed or self.failure else _EXIT_S)
        met = self._process.limits_met(code, has_ended_itself=not is_dismissed and self.failure is None)
        for name in met:
            self._note(name)
        if self.failure is None:
            self.failure = self._how(code, met)
        with self._lock:
            self._has_pipes = False
            os.close(self._wake_read)
            os.close(self._wake_write)
        self._on_change()

    def _how(self, code: int, met: list[str]) -> str:
        if met:
            return "its process met its limit of " + " and of ".join(self._describe(name) for name in met)
        return f"its process ended with exit code {code}"

    def _describe(self, name: str) -> str:
        return f"{_WORDS[name]} ({name} = {getattr(self._limits, name)})"

    def _note(self, name: str) -> None:
        if name not in self._noted:
            self._noted.add(name)
            self._counted.append(f"{_WORDS[name]} limit")
            self._on_limit(_WORDS[name])


def _read_faults(told: list[Any]) -> Faults:
    """Return the faults that a stranger has told of itself, none of them too long; `UnreadableError` if they are none."""
    match told:
        case [int(raised), int(illegal), str() | None as traceback, dict(reasons)] if raised >= 0 and illegal >= 0:
            faults = Faults(raised=raised, illegal=illegal, first_traceback=traceback and traceback[:_MOST_LETTERS])
            for kind, reason in reasons.items():
                match kind, reason:
                    case str(), [str(sentence), int(count)] if count > 0:
                        faults.note(kind[:_MOST_WORDS_LETTERS], sentence[:_MOST_WORDS_LETTERS], count)
                    case _:
                        raise UnreadableError("no reason for a fault")
            return faults
    raise UnreadableError("no faults")
