"""The ground on which a soak stands: its folder, its processes, its small disks, and which faults cannot be had here."""

import sys
from contextlib import ExitStack
from pathlib import Path

from arena.errors import ArenaError
from arena.jit import cache_root
from benchmarks.measuring.faults import LASTS_S, Kind, Target, fill, small_disk
from benchmarks.measuring.machines import ARENA
from benchmarks.measuring.supervised import Supervised

SELDOM = 0.2
"""Weight of what ends a process that is to live long, so that it can be seen whether its memory grows."""


class Ground:
    """What all parts of a soak stand on; what is opened here ends with `stack`."""

    def __init__(self, folder: Path, stack: ExitStack, duration_s: float) -> None:
        self.folder, self.stack = folder, stack
        self._disk_mb = 64 + int(duration_s / 15)
        self.parts: list[Supervised] = []
        self.not_drawn: dict[str, str] = {}
        """Faults that cannot be had here, and why."""

    def start(
        self, name: str, *words: str, is_forever: bool = True, is_arena: bool = True, environment: dict[str, str] | None = None
    ) -> Supervised:
        """Return a process that is kept running: an `arena` command, or a file of Python."""
        command = [sys.executable, *(["-P", "-c", ARENA] if is_arena else []), *words]
        its = {"ARENA_CONFIG": str(self.folder / "config" / name), "NUMBA_CACHE_DIR": str(cache_root()), **(environment or {})}
        part = self.stack.enter_context(Supervised(name, command, self.folder, its, is_forever=is_forever))
        self.parts.append(part)
        return part

    def disk(self, whose: str) -> tuple[Path, list[Kind]]:
        """Return a new folder, and the fault that its disk is full, if that can be had."""
        folder, name = self.folder / whose, f"full disk of the {whose}"
        try:
            self.stack.enter_context(small_disk(folder, self._disk_mb))
        except ArenaError as error:
            self.not_drawn[name] = str(error)
            return folder, []
        target = Target(name=whose, inflict=fill(folder))
        return folder, [Kind(name=name, find=lambda: [target], lasts_s=LASTS_S, weight=SELDOM)]
