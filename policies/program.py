"""A bot in any language: a program that reads JSON from stdin and answers on stdout, a line each.

    to it    {"type": "start", "team": "red", "ruleset": {...}}
    to it    {"type": "observation", "tick": 0, "ground": [[...]], "grid": [[...]], "units": [...], "enemies": [...], ...}
    from it  [0, 1, 2, 3, 4, 0]                         one action for each of `units`, in their order
    or       {"orders": [0, 1, ...], "log": ["text"], "draw": [{"cell": [3, 4], "colour": "red", "text": "A"}]}
    to it    {"type": "end", "ending": "capture", "winner": "red", "score": 100, "ticks": 23, "reason": ""}

Every field is named as in `arena.game.observation.Observation`; `log` and `draw` are described in `arena.annotations`. A program
plays match after match, one at a time, until its stdin closes. What it writes to stderr is shown. A line on stdout that is not
JSON, printed to debug perhaps, is shown and skipped, and the next one is read. A program that ends, or answers nonsense, leaves
its units where they are; it is started anew for the next match.
"""

import atexit
import json
import logging
import os
import shlex
import signal
import subprocess
import weakref
from contextlib import suppress
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import IO, Any

from arena.bot_calls import groups, stacks
from arena.console import clean
from arena.errors import PolicyError
from arena.game.observation import EnemyUnit, Observation, OwnUnit
from arena.game.ruleset import to_dict
from arena.policy import MatchInfo, MatchResult
from policies.each_seat import BotError, MakeBot

logger = logging.getLogger(__name__)
PREFIX = "exec:"
"""Stands before a program's command line where a fighter is named."""
stacks.OURS.add(__file__)  # it waits for its program
MOST_LINE_BYTES = 1 << 16
MOST_SKIPPED = 100
"""Lines that are not JSON, before one answer."""
_MOST_SHOWN = 80
_EXIT_WAIT_S = 1.0
_SCRIPTS = {
    ".bash", ".cjs", ".class", ".dll", ".exs", ".jar", ".jl", ".js", ".lua", ".mjs", ".php", ".pl", ".py", ".pyz", ".r", ".rb",
    ".sh", ".ts",
}  # fmt: skip
"""How the files end that an interpreter is given to run."""


class ProgramError(BotError):
    """A program ended, or wrote what cannot be read; counted against its seat."""


class SkippedLines:
    """Shows the first line of a program that is not JSON, and counts the others."""

    def __init__(self, name: str) -> None:
        self._name, self._n = name, 0

    def add(self, line: bytes) -> None:
        """Take one; of those after the first, only the 10th, the 100th and so on are told of."""
        self._n += 1
        if self._n == 1:
            logger.warning("%s wrote a line that is not JSON, which is skipped: %s", self._name, _shown(line))
        elif str(self._n).strip("0") == "1":
            logger.warning("%s has written %d lines that are not JSON", self._name, self._n)


def _shown(line: bytes) -> str:
    text = clean(line.decode("utf-8", "replace").strip())
    return text if len(text) <= _MOST_SHOWN else text[:_MOST_SHOWN] + "..."


class Program:
    """A running program."""

    def __init__(self, command: list[str], skipped: SkippedLines | None = None) -> None:
        self._skipped = skipped or SkippedLines(name_of(shlex.join(command)))
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
        groups.note(self._process.pid)
        atexit.register(self.close)

    @property
    def _pipes(self) -> tuple[IO[bytes], IO[bytes]]:
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            raise ProgramError("the program has no pipes")
        return stdin, stdout

    def send(self, message: dict[str, Any]) -> None:
        """Write a line."""
        try:
            self._pipes[0].write(json.dumps(message, separators=(",", ":")).encode() + b"\n")
            self._pipes[0].flush()
        except (OSError, ValueError) as error:
            raise ProgramError(self._exit_message()) from error

    def receive(self) -> Any:
        """Return the next line that is JSON, read."""
        for _ in range(MOST_SKIPPED):
            line = self._pipes[1].readline(MOST_LINE_BYTES)
            if not line.endswith(b"\n"):
                is_too_long = len(line) == MOST_LINE_BYTES
                raise ProgramError(f"a line has more than {MOST_LINE_BYTES} bytes" if is_too_long else self._exit_message())
            try:
                return json.loads(line)
            except (ValueError, RecursionError):
                self._skipped.add(line)
        raise ProgramError(f"it wrote {MOST_SKIPPED} lines that are not JSON, and no answer; the last was: {_shown(line)}")

    def _exit_message(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_EXIT_WAIT_S)
        return f"the program ended with exit code {self._process.returncode}, or closed its stdin or stdout"

    def close(self) -> None:
        """Close its stdin, and end it and all its children if that is not enough."""
        self._close_pipes()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_EXIT_WAIT_S)
        self.kill()

    def kill(self) -> None:
        """End it and all its children at once."""
        atexit.unregister(self.close)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        groups.forget(self._process.pid)
        self._process.wait()
        self._close_pipes()

    def _close_pipes(self) -> None:
        for pipe in self._pipes:
            with suppress(OSError):
                pipe.close()


class ProgramBot:
    """One match of a program, which ends with a bot that is dropped before the match has ended."""

    def __init__(self, command: list[str], idle: list[Program], skipped: SkippedLines | None = None) -> None:
        self._idle = idle
        program = idle.pop() if idle else Program(command, skipped)
        self._program: Program | None = program
        self._drop = weakref.finalize(self, program.kill)
        self._drop.atexit = False  # the program sees to that itself

    def start(self, info: MatchInfo) -> None:
        """Send what the match is played under."""
        self._send({"type": "start", "team": info.team.name.lower(), "ruleset": to_dict(info.ruleset)})

    def act(self, observation: Observation) -> Any:
        """Show it what its team sees, and return its answer."""
        self._send(to_json(observation))
        try:
            answer = self._running().receive()
        except ProgramError:
            self._close()
            raise
        if not isinstance(answer, dict):
            return answer
        if observation.annotations is not None:
            observation.annotations.add(answer)
        return answer.get("orders")

    def end(self, result: MatchResult) -> None:
        """Send how the match ended; the program is kept for the next."""
        self._send({"type": "end", **result.to_dict()})
        if self._program is not None:
            self._drop.detach()
            self._idle.append(self._program)
            self._program = None

    def _send(self, message: dict[str, Any]) -> None:
        try:
            self._running().send(message)
        except ProgramError:
            self._close()
            raise

    def _running(self) -> Program:
        if self._program is None:
            raise ProgramError("the program ended earlier in this match")
        return self._program

    def _close(self) -> None:
        if self._program is not None:
            self._drop.detach()
            self._program.close()
            self._program = None


def load_program(command_line: str) -> MakeBot:
    """Return what makes the bot of a command line.

    Raises
    ------
    PolicyError
        The command line cannot be read, or names no program that can be started.
    """
    try:
        command = shlex.split(command_line)
    except ValueError as error:
        raise PolicyError(f"the command line {command_line!r} cannot be read: {error}") from error
    if not command:
        raise PolicyError("the command line is empty; name a program")
    idle, skipped = _idle(command_line), _skipped(command_line)
    if not idle:
        try:
            idle.append(Program(command, skipped))
        except OSError as error:
            raise PolicyError(f"cannot start {command[0]}: {error.strerror}") from error
        except ValueError as error:
            raise PolicyError(f"the command line {command_line!r} cannot be started: {error}") from error
    return lambda: ProgramBot(command, idle, skipped)


def name_of(command_line: str) -> str:
    """Return what a program is called that was given no name: its script's name, as in `node bots/fast.js`, else its own."""
    try:
        words = shlex.split(command_line)
    except ValueError:
        words = command_line.split()
    scripts = (word for word in words if Path(word).suffix.lower() in _SCRIPTS)
    return Path(next(scripts, words[0] if words else "")).stem


@cache
def _skipped(command_line: str) -> SkippedLines:
    """Return the count for all programs of a command line in this process: many play at once, and say the same."""
    return SkippedLines(name_of(command_line))


@cache
def _idle(command_line: str) -> list[Program]:
    """Return the programs of a command line that wait for a match, in this process."""
    return []


def to_json(seen: Observation) -> dict[str, Any]:
    """Return an observation as a program reads it: its fields, and what is computed from them."""
    values: dict[str, Any] = {"type": "observation"}
    for field in fields(seen):
        value = getattr(seen, field.name)
        if field.name == "annotations":
            continue
        if field.name == "ground":
            values |= {"ground": value.tolist(), "grid": seen.grid.tolist()}
        elif isinstance(value, tuple):
            values[field.name] = [asdict(item) if isinstance(item, OwnUnit | EnemyUnit) else item for item in value]
        else:
            values[field.name] = value
    return values | {"team": seen.team.name.lower(), "legal_actions": seen.legal_actions.tolist()}
