"""A soak: a pit with a ladder, and a league over the network, while processes, disks, networks, a machine and a database fail.

What a supervisor would start again, this does. At the end everything is counted: a match that is lost or stored twice, a journal
that does not verify, or memory that grows for ever breaks a promise, and the command ends with exit code 1.
"""

import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from secrets import randbelow
from typing import Any

from arena.errors import ArenaError
from benchmarks.measuring.soak_ground import Ground
from benchmarks.measuring.soaked_league import SoakedLeague
from benchmarks.measuring.soaked_pit import SoakedPit
from benchmarks.measuring.trends import Growth
from policies.precompile import precompile
from policies.registry import load

ENTRIES = {"ann": "patrol", "bob": "rush", "cyd": "roomba", "dan": "random"}
"""Of the pit; each plays through a network of its own."""
_EVERY_S = 4.0
"""Mean time from the end of a fault to the next."""
_POLL_S, _LOOK_S, _SAY_S = 0.2, 2.0, 30.0
_COME_S, _END_S = 180.0, 300.0
"""How long the first matches may take to come, and the last ones to end."""
_REMEMBERED_KB = 6.0
"""Of a match, which a pit remembers until 10,000 others have been played."""
Progress = Callable[[str], None]


def run(progress: Progress, minutes: float = 2.0, seed: int | None = None) -> dict[str, Any]:
    """A pit and a league while processes, disks, networks, a machine and a database fail; whether anything is lost, or grows."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end all processes, too
    return measure(progress, duration_s=60 * minutes, seed=randbelow(1 << 31) if seed is None else seed)


def measure(
    progress: Progress,
    *,
    duration_s: float,
    seed: int,
    entries: dict[str, str] | None = None,
    has_league: bool = True,
    every_s: float = _EVERY_S,
    n_workers: int = 2,
    n_far_workers: int = 1,
) -> dict[str, Any]:
    """Let it soak for a while, and check what came of it."""
    entries = entries or ENTRIES
    progress(f"seed {seed}")
    for policy in {*entries.values(), "patrol"}:
        precompile(load(policy))  # here, and not in all processes at once
    with tempfile.TemporaryDirectory(prefix="arena-soak-", ignore_cleanup_errors=True) as name, ExitStack() as stack:
        ground = Ground(Path(name), stack, duration_s)
        pit = SoakedPit(ground, entries, seed, every_s=every_s, n_workers=n_workers, n_far_workers=n_far_workers)
        soak = _Soak(ground, pit, SoakedLeague(ground, seed, every_s=every_s) if has_league else None)
        soak.go_on(duration_s, progress)
        progress("every journal, played again")
        return {"seed": seed, "minutes": round(duration_s / 60, 2), **soak.audit()}


class _Soak:
    """All that soaks, from its first match to its audit."""

    def __init__(self, ground: Ground, pit: SoakedPit, league: SoakedLeague | None) -> None:
        self._ground, self._pit, self._league = ground, pit, league
        self._soaked: list[SoakedPit | SoakedLeague] = [pit] if league is None else [pit, league]
        self._growth = Growth()
        self._broken: list[str] = []
        self._took_min = 0.0

    # While it goes on

    def go_on(self, duration_s: float, progress: Progress) -> None:
        """Let everything come, fail for a while, and come to its end."""
        come_by_s = time.monotonic() + _COME_S
        while not all(one.injector.watch.seen for one in self._soaked):
            self._tend(progress, may_begin=False)
            if time.monotonic() > come_by_s:
                said = "; ".join(f"{part.name}: {part.last_words}" for part in self._ground.parts)
                raise ArenaError(f"no match began within {_COME_S:.0f} s; what was said last: {said}")
        begun_s = time.monotonic()
        looked_s = said_s = 0.0
        while (now_s := time.monotonic()) < begun_s + duration_s:
            self._tend(progress, may_begin=True, at_s=now_s - begun_s)
            if now_s - looked_s >= _LOOK_S:
                looked_s = now_s
                for one in self._soaked:
                    self._growth.look(one.roles(), now_s)
            if now_s - said_s >= _SAY_S:
                said_s = now_s
                progress(f"{now_s - begun_s:.0f} of {duration_s:.0f} s, {self._describe()}")
        self._took_min = (time.monotonic() - begun_s) / 60
        self._finish(progress)

    def _describe(self) -> str:
        injectors = [one.injector for one in self._soaked]
        return ", ".join(f"{len(one.watch.seen)} matches and {len(one.faults)} faults in the {one.name}" for one in injectors)

    def _tend(self, progress: Progress, *, may_begin: bool, at_s: float = 0.0, may_grow: bool = True) -> None:
        for part in self._ground.parts:
            part.tend()
        if self._league is not None:
            self._league.tend(may_grow=may_grow)
        for one in self._soaked:
            begun = one.injector.tend(may_begin=may_begin)
            if begun:
                progress(f"{at_s:.0f} s: {begun}")
        time.sleep(_POLL_S)

    def _finish(self, progress: Progress) -> None:
        """Let the last fault pass, the league end, and the pit close."""
        progress(f"no more faults; {self._describe()}")
        by_s = time.monotonic() + _END_S
        league = None if self._league is None else self._league.process
        while not all(one.injector.is_calm for one in self._soaked) or (league is not None and not league.has_finished):
            self._tend(progress, may_begin=False, may_grow=False)
            if time.monotonic() > by_s:
                self._broken.append(
                    f"{_END_S:.0f} s after the last fault, the league had not ended: {league and league.last_words}"
                )
                break
        pit = self._pit.process
        while not pit.is_running:
            self._tend(progress, may_begin=False, may_grow=False)
        code = pit.finish(60.0)
        if code != 0:
            self._broken.append(f"the pit ended with exit code {code}: {pit.last_words}")

    # Afterwards

    def audit(self) -> dict[str, Any]:
        """Return what came of it."""
        stores = ["sqlite", *([] if self._league is None else [self._league.store])]
        figures: dict[str, Any] = {"store": " and ".join(dict.fromkeys(stores))}
        broken, faults = self._broken, dict[str, Any]()
        for one in self._soaked:
            injector, found = one.injector, one.audit()
            in_faults = sum(fault.n_late for fault in injector.faults)
            late = {"in_faults": in_faults, "outside": injector.watch.count_late() - in_faults}
            figures[injector.name] = {**found.figures, "late_turns": late}
            faults |= injector.costs()
            broken += [*injector.broken(), *found.broken]
        figures["faults"], figures["not_drawn"] = faults, self._ground.not_drawn
        exits: Counter[str] = Counter()
        for part in self._ground.parts:
            exits.update({f"{'client' if self._pit.is_client(part) else part.name} {code}": n for code, n in part.exits.items()})
        figures["exits"] = dict(sorted(exits.items()))
        remembered_kb = _REMEMBERED_KB * figures[self._pit.injector.name]["matches"] / self._took_min
        figures["growth_per_min"], grown = self._growth.judge({"pit": remembered_kb})
        broken += [f"{path.name} tells of a traceback: {said}" for path in self._logs() if (said := _find_traceback(path))]
        return {**figures, "broken": [*broken, *grown]}

    def _logs(self) -> list[Path]:
        folder = self._ground.folder
        return sorted([*folder.glob("*.log"), *folder.glob("*/journals/**/*.log")])


def _find_traceback(log: Path) -> str:
    """Return what a process raised that ought to have said a sentence; nothing if none did."""
    lines = log.read_text(errors="replace").splitlines()
    for number, line in enumerate(lines):
        if line.startswith("Traceback"):
            return next((later for later in lines[number + 1 :] if later and not later.startswith(" ")), line)
    return ""
