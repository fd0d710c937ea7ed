"""The processes of entries on the network, and how often a process that dies is started anew.

A client ends by itself when the scheduler is gone: whoever starts the league again starts it with processes of its own.
"""

import logging
import os
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from arena.folders import data_folder
from arena.jit import cache_root
from arena.network.address import Address
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox, SandboxedProcess
from policies.registry import OWN
from policies.workers.files import resolve
from tournaments.venues.setting import Fighter, VenueSetting

if TYPE_CHECKING:
    from tournaments.venues.fork_server import ForkedProcess, ForkServer

MOST_DEATHS = 3
"""Times in a row that a process which died young is started anew."""
YOUNG_S = 60.0
"""A process that lived longer was not broken from its start."""
RETRY_S = 600.0
"""Whoever was given up is as good as any other after this time."""
RUN_ARENA = "from tournaments.cli import main; main()"
"""What an interpreter is given with `-c`, for a module below that of the command."""
_PATIENCE_S = 20
GOODBYE_S = 5.0
"""For a process that was asked to end."""
HUNG_S = 30.0
"""A client that gave no sign of life for so long is started anew."""
logger = logging.getLogger(__name__)


class RestartLimit:
    """Counts how often a process died young, and says when it is to be started no more."""

    def __init__(self, who: str, log: Path) -> None:
        self._who, self._log = who, log
        self._n_deaths, self._born_at_s = 0, 0.0

    def note_start(self) -> None:
        """Count from here how long it lives."""
        self._born_at_s = time.monotonic()

    def note_death(self) -> None:
        """Count a death."""
        lived_s = time.monotonic() - self._born_at_s
        self._n_deaths = self._n_deaths + 1 if lived_s < YOUNG_S else 1

    @property
    def is_reached(self) -> bool:
        """Whether it died too often."""
        return self._n_deaths > MOST_DEATHS

    @property
    def is_near(self) -> bool:
        """Whether it died twice in a row, and has not lived long since."""
        return self._n_deaths > 1 and time.monotonic() - self._born_at_s < YOUNG_S

    def failure_message(self, reason: str = "") -> str:
        """Return how it died, in one sentence."""
        why = f": {reason}" if reason else f"; {self._log} says why"
        return f"{self._who} died {self._n_deaths} times in a row{why}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Absence:
    """Since when a client is kept away."""

    n_ended: int
    """Matches of its entry that had ended then."""
    give_up_at_s: float
    """By then the referee has ruled, if there is anything to rule on."""


_TRUSTED = Sandbox(has_wall=False, limits=NO_LIMITS)
_MOST_LOG_BYTES, _KEPT_LOG_BYTES = 2 << 20, 1 << 19
"""A fighter may print so much each time its client starts, which it does thousands of times in a season."""


class ClientProcess:
    """`arena join` as a process, once it is started; what it says goes to a log beside the journals.

    Parameters
    ----------
    fork_server
        Starts the clients of our own fighters; without it, each has an interpreter of its own, as those of others have.
    """

    def __init__(
        self, setting: VenueSetting, address: Address, name: str, fighter: Fighter, fork_server: "ForkServer | None" = None
    ) -> None:
        self.name = name
        self._log = setting.journals / f"{name}.log"
        self._home = (setting.homes / name).absolute()
        self._notes, self._alive = self._home / "notes", self._home / "alive"
        sandbox = fighter.sandbox or _TRUSTED
        self._words = [
            "join",
            str(address),
            "--key",
            str(entry_key_path(setting, name).absolute()),
            "--no-transcripts",
            "--no-audit",
            "--name",
            name,
            "--policy",
            resolve(fighter.spec)[0],  # it starts at home
            "--forever",
            "--slots",
            str(setting.slots),
            "--patience",
            str(_PATIENCE_S),
            "--sandbox" if sandbox.has_wall else "--no-sandbox",
            "--notes",
            str(self._notes),
            "--alive",
            str(self._alive),
            *(f"--limit={assignment}" for assignment in sandbox.limits.assignments()),
        ]
        self._restarts = RestartLimit(f"the client of {name}", self._log)
        self._grace_s = setting.time_control.grace_s
        self._away: _Absence | None = None
        self._fork_server = fork_server if may_fork(fighter) else None
        self._started: SandboxedProcess | ForkedProcess | None = None
        data_folder(self._home, 0o700)
        self._notes.unlink(missing_ok=True)
        self._n_noted = 0

    def start(self) -> None:
        """Start it; the kernel ends it with the thread that does."""
        self._away = None
        self._restarts.note_start()
        self._alive.unlink(missing_ok=True)
        _shorten(self._log)
        with self._log.open("ab") as log:
            if self._fork_server is not None:
                self._started = self._fork_server.fork(self._words, self._home, log)
            else:
                command = [sys.executable, "-P", "-c", RUN_ARENA, *self._words]
                self._started = SandboxedProcess(command, _TRUSTED, client_environment(self._home), cwd=self._home, log=log)

    @property
    def is_running(self) -> bool:
        """Whether the process is there."""
        return self._started is not None and self._started.is_running

    @property
    def is_failing(self) -> bool:
        """Whether it dies again and again, or is kept away since it did."""
        away = self._away
        return self._restarts.is_near if away is None else time.monotonic() - away.give_up_at_s < RETRY_S

    def terminate(self) -> None:
        """Ask it to end; `end` waits for that."""
        if self._started is not None:
            self._started.terminate()

    def end(self, patience_s: float = GOODBYE_S) -> None:
        """End it and all that it started, unless it does so by itself soon."""
        if self._started is not None:
            self._started.end(patience_s)
            self._started = None

    def take_limits_met(self) -> Counter[str]:
        """Return how often the fighter met each of its limits since the last call."""
        try:
            lines = self._notes.read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            return Counter()
        new, self._n_noted = lines[self._n_noted :], len(lines)
        return Counter(f"{line} limit" for line in new)

    def _hangs(self) -> bool:
        """Whether the process is there, and does nothing: it leaves a sign of life several times a second."""
        try:
            seen_at_s = self._alive.stat().st_mtime
        except FileNotFoundError:
            return False  # it still starts, or dies, which is seen elsewhere
        if time.time() - seen_at_s <= HUNG_S:
            return False
        logger.warning("the client of %s gave no sign of life for %g s; it is started anew", self.name, HUNG_S)
        return True

    def keep_alive(self, n_ended: int) -> str:
        """Start it anew if it died or hangs.

        One that dies again and again stays away until the referee has ruled that it forfeits what it was in the middle of: a bot
        that cannot live through a match loses it, and ends nobody's league.

        Parameters
        ----------
        n_ended
            Matches of its entry that have ended.

        Returns
        -------
        str
            Why it is started no more: it died again and again, and no match was there to be ruled on, for it does not come as
            far as that. Else nothing.
        """
        if self._away is None and self.is_running and not self._hangs():
            return ""
        if self._away is None:
            self.end(0)
            self._restarts.note_death()
            if self._restarts.is_reached:
                logger.warning("%s; what it is in the middle of is forfeited", self._restarts.failure_message())
                self._away = _Absence(n_ended=n_ended, give_up_at_s=time.monotonic() + self._grace_s + _PATIENCE_S)
                return ""
        elif n_ended == self._away.n_ended:
            return self._restarts.failure_message() if time.monotonic() > self._away.give_up_at_s else ""
        self.start()
        return ""


def may_fork(fighter: Fighter) -> bool:
    """Return whether the client of a fighter may be a fork: it is one of our own, which plays in the client itself."""
    return fighter.sandbox is None and fighter.spec in OWN


def client_environment(home: Path) -> dict[str, str]:
    """Return the whole environment of a client: ours, with a home of its own, and the kernels that we have compiled."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "ARENA_CONFIG"))}
    return environment | {"HOME": str(home), "NUMBA_CACHE_DIR": str(cache_root())}


def _shorten(log: Path) -> None:
    """Keep the end of a log that has grown too long."""
    with suppress(FileNotFoundError):
        if log.stat().st_size > _MOST_LOG_BYTES:
            with log.open("r+b") as file:
                file.seek(-_KEPT_LOG_BYTES, os.SEEK_END)
                end = file.read()
                file.seek(0)
                file.write(end)
                file.truncate()


def entry_key_path(setting: VenueSetting, name: str) -> Path:
    """Return where the key of an entry lives."""
    return setting.keys / "entries" / f"{name}.key"
