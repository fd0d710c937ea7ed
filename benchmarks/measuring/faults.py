"""Faults that are drawn at random, one after another, and what each costs the matches that it strikes."""

import errno
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from arena.errors import ArenaError
from benchmarks.measuring.journal_watch import JournalWatch

LASTS_S = (0.5, 8.0)
"""Of what is stopped, cut or full."""
PATIENCE_S = 90.0
"""How long after a fault is over it may take until play goes on."""
_AFTER_S = 4.0
"""So long after a fault is over, what it brought down is down: whoever plays then has come back, or never left."""
_PLAYING_S = 1.5
"""A match that has gone on within so long is played."""
_BALLAST = "ballast"
Repair = Callable[[], None]
Inflict = Callable[[], Repair | None]
"""Does it, and returns what ends it; None where a supervisor does, or it is over at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What a fault may strike now."""

    name: str
    inflict: Inflict
    entry: str = ""
    """Whose matches have to go on; anyone's without it."""
    is_of_all: bool = False
    """Whether each match that is played has to go on, and not just one of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of fault."""

    name: str
    find: Callable[[], Sequence[Target]]
    """Returns what it can strike now."""
    lasts_s: tuple[float, float] = (0.0, 0.0)
    """At least, and at most."""
    weight: float = 1.0
    """How often it is drawn, beside others."""


@dataclass(slots=True, kw_only=True)
class Fault:
    """One that was drawn."""

    kind: str
    target: str
    entry: str
    at_s: float
    until_s: float
    late_before: int
    repair: Repair | None
    grown_at_s: float
    """When somebody of those whom it strikes was seen to play last."""
    awaited: dict[str, float] | None
    """Matches that were played when it began and are not over, each with when it was seen to go on last; None if any would do."""
    still_s: float = 0.0
    """The longest that nobody of them played."""
    is_stuck: bool = False
    """Nobody played on."""
    is_excused: bool = False
    """Nobody had to play meanwhile, so how long nobody did says nothing."""
    n_late: int = 0


class FaultInjector:
    """Where matches are played, and one fault follows another; one thread tends it."""

    def __init__(self, name: str, watch: JournalWatch, kinds: Sequence[Kind], seed: int, *, every_s: float) -> None:
        self.name, self.watch = name, watch
        self._kinds, self._random, self._every_s = kinds, random.Random(f"{seed} {name}"), every_s
        self._next_s = time.monotonic() + self._random.expovariate(1 / every_s)
        self._drawn = self._draw()
        self._now: Fault | None = None
        self._is_idle = False
        """Whether nobody has played since there was nothing to play."""
        self.faults: list[Fault] = []
        """Those that are over."""

    def _draw(self) -> tuple[Kind, float, float]:
        """Return the next kind, which of its targets, and how long it lasts: they depend on the seed alone."""
        (kind,) = self._random.choices(self._kinds, [kind.weight for kind in self._kinds])
        return kind, self._random.random(), self._random.random()

    def tend(self, *, may_begin: bool) -> str:
        """Go on, and return what has begun, in words; nothing if nothing has.

        Parameters
        ----------
        may_begin
            Whether another fault may begin; if not, the one that goes on still does.
        """
        grown, now_s = self.watch.look(), time.monotonic()
        self._is_idle = self._is_idle and not grown
        if self._now is not None:
            self._go_on(self._now, grown, now_s)
        elif may_begin and now_s >= self._next_s:
            return self._begin()
        return ""

    @property
    def is_calm(self) -> bool:
        """Whether no fault goes on."""
        return self._now is None

    def excuse(self) -> None:
        """Take note that there was nothing to play until now, whatever fault goes on."""
        self._is_idle = True
        if self._now is not None:
            self._now.is_excused, self._now.grown_at_s = True, time.monotonic()

    def _begin(self) -> str:
        kind, which, length = self._drawn
        targets = kind.find()
        if not targets:
            return ""  # until it is there
        target = targets[int(which * len(targets))]
        lasts_s = kind.lasts_s[0] + length * (kind.lasts_s[1] - kind.lasts_s[0])
        n_late = self.watch.count_late()
        repair = target.inflict()
        self.watch.look()
        now_s = time.monotonic()
        self._now = Fault(
            kind=kind.name, target=target.name, entry=target.entry, at_s=now_s,
            until_s=now_s + lasts_s, late_before=n_late, repair=repair, grown_at_s=now_s, is_excused=self._is_idle,
            awaited=dict.fromkeys(self.watch.played_within(_PLAYING_S), now_s) if target.is_of_all else None,
        )  # fmt: skip
        self._drawn = self._draw()
        return f"{kind.name}: {target.name}{f', for {lasts_s:.1f} s' if lasts_s else ''}"

    def _go_on(self, fault: Fault, grown: set[str], now_s: float) -> None:
        if fault.awaited is not None:
            self._await_all(fault, fault.awaited, grown, now_s)
        elif any(not fault.entry or fault.entry in identity.split("/") for identity in grown):
            fault.still_s, fault.grown_at_s = max(fault.still_s, now_s - fault.grown_at_s), now_s
        if now_s < fault.until_s:
            return
        if fault.repair is not None:
            fault.repair()
            fault.repair = None
        fault.is_stuck = now_s - max(fault.until_s, fault.grown_at_s) > PATIENCE_S
        if fault.is_stuck or (fault.grown_at_s == now_s and now_s - fault.until_s > _AFTER_S):
            fault.n_late = self.watch.count_late() - fault.late_before
            self.faults.append(fault)
            self._now = None
            self._next_s = now_s + self._random.expovariate(1 / self._every_s)

    def _await_all(self, fault: Fault, awaited: dict[str, float], grown: set[str], now_s: float) -> None:
        """Note which matches have gone on; nobody waits for those that are over."""
        for identity, since_s in list(awaited.items()):
            if identity in grown:
                fault.still_s, awaited[identity] = max(fault.still_s, now_s - since_s), now_s
            elif now_s - since_s > _PLAYING_S and self.watch.has_ended(identity):
                del awaited[identity]
        fault.grown_at_s = min(awaited.values(), default=now_s)
        if now_s - fault.grown_at_s < _PLAYING_S:
            fault.grown_at_s = now_s

    def costs(self) -> dict[str, dict[str, float]]:
        """Return what the faults of each kind cost."""
        found: dict[str, dict[str, float]] = {}
        for kind in self._kinds:
            its = [fault for fault in self.faults if fault.kind == kind.name]
            still_s = [fault.still_s for fault in its if not fault.is_excused]
            found[kind.name] = {"n": len(its), "late_turns": sum(fault.n_late for fault in its)}
            if still_s:
                found[kind.name] |= {"still_s": round(median(still_s), 1), "still_most_s": round(max(still_s), 1)}
        return found

    def broken(self) -> list[str]:
        """Return after which faults nobody played on, in sentences."""
        return [
            f"in the {self.name}, nobody played on for {PATIENCE_S:g} s after: {fault.kind} ({fault.target})"
            for fault in self.faults
            if fault.is_stuck
        ]


def kill(pids: Sequence[int]) -> Inflict:
    """Return what kills processes."""
    return lambda: _send(pids, signal.SIGKILL)


def stop(pids: Sequence[int]) -> Inflict:
    """Return what stops processes until they are repaired."""

    def inflict() -> Repair:
        _send(pids, signal.SIGSTOP)
        return lambda: _send(pids, signal.SIGCONT)

    return inflict


Found = Sequence[tuple[str, list[int], str]]
"""What could be struck: its name, its processes, and whose matches have to go on, anyone's if that is empty."""


def signals(what: str, find: Callable[[], Found], weight: float = 1.0, *, is_of_all: bool = False) -> list[Kind]:
    """Return the kinds of fault of a process: it is killed, or stopped for a while."""
    return [
        Kind(name=f"kill {what}", find=lambda: targets(kill, find(), is_of_all=is_of_all), weight=weight),
        Kind(name=f"stop {what}", find=lambda: targets(stop, find(), is_of_all=is_of_all), lasts_s=LASTS_S),
    ]


def targets(how: Callable[[Sequence[int]], Inflict], found: Found, *, is_of_all: bool = False) -> list[Target]:
    """Return those of them that are there, to be struck in this way."""
    return [Target(name=name, inflict=how(pids), entry=entry, is_of_all=is_of_all) for name, pids, entry in found if pids]


def fill(disk: Path) -> Inflict:
    """Return what fills a disk until it is repaired."""

    def inflict() -> Repair:
        ballast = disk / _BALLAST
        with ballast.open("wb", buffering=0) as file:
            for n_bytes in (1 << 20, 1 << 12, 1):
                try:
                    while file.write(bytes(n_bytes)) == n_bytes:
                        pass
                except OSError as error:
                    if error.errno != errno.ENOSPC:
                        raise
        return ballast.unlink

    return inflict


def _send(pids: Sequence[int], number: int) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


@contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[None]:
    """Make a folder a disk of its own, in memory; `ArenaError` where that is not permitted, with the reason."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m,mode=700", "arena-soak", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise ArenaError("there is no command mount") from None
    if done.returncode:
        raise ArenaError(done.stderr.strip() or "mount failed")
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=False)
