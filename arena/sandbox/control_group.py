"""A control group for one process and all that it starts: its memory, its processes and its share of the processors.

Both versions of the kernel's interface are known, since either is found. A group is made below that of this process, or, in
version 2, which keeps processes out of groups with children, beside it. Where neither is allowed there is none.
"""

import logging
import os
import signal
import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from arena.sandbox.limits import Limits

ROOT = Path("/sys/fs/cgroup")
_MIB = 1 << 20
_PERIOD_US = 100_000
_WEIGHT_V2, _SHARES_V1 = "50", "512"  # half of what others have
_PREFIX = "arena-"
_POLL_S, _KILL_S = 0.001, 5.0
_numbers = count()
logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ControlGroup:
    """Folders of the kernel, one for each controller in version 1, one for all in version 2."""

    folders: dict[str, Path]
    """By controller: memory, pids, cpu."""

    @classmethod
    def make(cls, limits: Limits, root: Path = ROOT) -> "ControlGroup | None":
        """Make a group under limits; None where that is not allowed here."""
        if not root.is_dir():
            return None
        is_v2 = (root / "cgroup.controllers").exists()
        parents = _parents_v2(root) if is_v2 else _parents_v1(root)
        if parents is None:
            return None
        # A maker that was killed may have had our number, as in a container, where it is always the same.
        names = (f"{_PREFIX}{os.getpid()}-{number}" for number in _numbers)
        name = next(name for name in names if not any((parent / name).exists() for parent in parents.values()))
        group = cls({controller: parent / name for controller, parent in parents.items()})
        try:
            for folder in group._distinct:
                _remove_stale(folder.parent)
                folder.mkdir()
            group._set(limits, is_v2=is_v2)
        except OSError as error:
            logger.info("no control group can be made in %s: %s", root, error.strerror)
            group.remove()
            return None
        return group

    @property
    def entrances(self) -> list[str]:
        """The files into which a process writes its number to come under the group."""
        return [str(folder / "cgroup.procs") for folder in self._distinct]

    @property
    def _distinct(self) -> list[Path]:
        return list(dict.fromkeys(self.folders.values()))

    def _set(self, limits: Limits, *, is_v2: bool) -> None:
        memory, pids, cpu = (self.folders[controller] for controller in ("memory", "pids", "cpu"))
        if limits.memory_mb is not None:
            n_bytes = str(limits.memory_mb * _MIB)
            (memory / ("memory.max" if is_v2 else "memory.limit_in_bytes")).write_text(n_bytes)
            swap = memory / ("memory.swap.max" if is_v2 else "memory.memsw.limit_in_bytes")
            if swap.exists():  # it depends on the kernel's configuration
                swap.write_text("0" if is_v2 else n_bytes)
        if limits.processes is not None:
            (pids / "pids.max").write_text(str(limits.processes))
        if limits.cores is not None:
            # Whose share is bounded waits for the referee, and not the other way round; a client of ours has no such bound.
            (cpu / ("cpu.weight" if is_v2 else "cpu.shares")).write_text(_WEIGHT_V2 if is_v2 else _SHARES_V1)
            quota_us = limits.cores * _PERIOD_US
            if is_v2:
                (cpu / "cpu.max").write_text(f"{quota_us} {_PERIOD_US}")
            else:
                (cpu / "cpu.cfs_period_us").write_text(str(_PERIOD_US))
                (cpu / "cpu.cfs_quota_us").write_text(str(quota_us))

    def limits_met(self) -> list[str]:
        """Return which limits were met, by the names of `Limits`."""
        memory = self.folders["memory"]
        out_of_memory = max(_count(memory / "memory.events", "oom_kill"), _count(memory / "memory.oom_control", "oom_kill"))
        refused = _count(self.folders["pids"] / "pids.events", "max")
        return [name for name, n in (("memory_mb", out_of_memory), ("processes", refused)) if n]

    def kill(self) -> None:
        """Kill all that is in it, whatever became of its parents."""
        with suppress(OSError):  # it is gone, and all that was in it
            (self.folders["pids"] / "pids.max").write_text("0")  # so that none is started meanwhile
            _kill_all(self.folders["pids"])

    def remove(self) -> None:
        """Remove the group; what still runs in it keeps it for `_remove_stale`."""
        for folder in self._distinct:
            with suppress(OSError):
                _remove(folder)


def _parents_v1(root: Path) -> dict[str, Path] | None:
    """Return the folders of this process' own groups."""
    own: dict[str, Path] = {}
    for line in Path("/proc/self/cgroup").read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        for controller in controllers.split(","):
            own[controller] = root / controller / path.lstrip("/")
    wanted = {controller: own.get(controller) for controller in ("memory", "pids", "cpu")}
    found = {controller: folder for controller, folder in wanted.items() if folder is not None and os.access(folder, os.W_OK)}
    return found if len(found) == len(wanted) else None


def _parents_v2(root: Path) -> dict[str, Path] | None:
    """Return the folder of a group that may have children under our controllers: this process' own, or the one above."""
    line = next(line for line in Path("/proc/self/cgroup").read_text().splitlines() if line.startswith("0::"))
    own = root / line.removeprefix("0::").lstrip("/")
    for folder in (own, own.parent):
        with suppress(OSError):
            enabled = (folder / "cgroup.subtree_control").read_text().split()
            missing = [name for name in ("memory", "pids", "cpu") if name not in enabled]
            if missing:
                (folder / "cgroup.subtree_control").write_text(" ".join(f"+{name}" for name in missing))
            if os.access(folder, os.W_OK) and os.access(folder / "cgroup.procs", os.W_OK):
                return dict.fromkeys(("memory", "pids", "cpu"), folder)
        if folder == root:
            break
    return None


def _remove_stale(parent: Path) -> None:
    """Remove groups whose maker was killed, with all that is left in them."""
    for folder in parent.glob(f"{_PREFIX}*-*"):
        maker = folder.name.removeprefix(_PREFIX).partition("-")[0]
        if not Path("/proc", maker).exists():
            with suppress(OSError):
                _kill_all(folder)
                _remove(folder)


def _remove(folder: Path) -> None:
    """Remove a group, and first those that its processes made in it, with all that is left in them."""
    for inner in folder.glob(f"{_PREFIX}*-*"):
        _kill_all(inner)
        _remove(inner)
    folder.rmdir()


def _kill_all(folder: Path) -> None:
    """Kill what is in a group, and wait until it is gone."""
    give_up_at_s = time.monotonic() + _KILL_S
    while (pids := (folder / "cgroup.procs").read_text().split()) and time.monotonic() < give_up_at_s:
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(int(pid), signal.SIGKILL)
        time.sleep(_POLL_S)


def _count(file: Path, key: str) -> int:
    """Return a number of a file of keys and numbers; 0 where there is none."""
    with suppress(OSError):
        for line in file.read_text().splitlines():
            name, _, number = line.partition(" ")
            if name == key and number.isdecimal():
                return int(number)
    return 0
