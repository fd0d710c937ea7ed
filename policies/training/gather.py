"""Processes that play matches, and add what is to be learned from them to a folder, until it holds as many as are wanted.

What was left out, and why: matches that are under way are not saved. Whoever goes on begins new ones, on maps of their own.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing.connection import wait
from multiprocessing.synchronize import Event
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from arena.errors import ArenaError
from policies.training.gather_settings import GatherSettings
from policies.training.record import ReportProgress
from policies.training.sample_folder import LostFolderError, SampleFolder

_LOOK_EVERY_S = 1.0


class Player(Protocol):
    """Plays matches in some rows without end, and tells what is to be learned from each that has ended."""

    @property
    def n_seats(self) -> int:
        """Seats from which something is to be learned."""

    def play_tick(self) -> Iterator[tuple[int, tuple[Any, ...]]]:
        """Play a tick in every row, and yield each seat whose match has ended, with its samples."""
        ...


MakePlayer = Callable[[Any, int, int], Player]
"""Makes the player of some settings, in a process, by its number, and a sitting; a class or a function of a module."""


def gather_alone(
    folder: SampleFolder[Any], make: MakePlayer, settings: GatherSettings, process: int, sitting: int, n_matches: int,
    should_stop: Callable[[], bool],
) -> None:  # fmt: skip
    """Add so many matches to the folder, in this process; what has ended is kept when it is stopped.

    Each seat has its share of them: if the first to end were kept, most of them would be short. A seat that has its share
    plays on, and nothing of that is kept.
    """
    torch.set_num_threads(1)
    player = make(settings, process, sitting)
    left = share_matches(n_matches, player.n_seats, sitting)
    kept: list[tuple[Any, ...]] = []
    while left.any() and not should_stop():
        for seat, match in player.play_tick():
            if left[seat]:
                kept.append(match)
                left[seat] -= 1
        if kept and (not left.any() or sum(len(match[0]) for match in kept) >= settings.file_samples):
            folder.add(process, kept)
            kept = []
    if kept:
        folder.add(process, kept)


def share_matches(n_matches: int, n_seats: int, first: int) -> NDArray[np.intp]:
    """Return how many matches are kept of each seat: equally many, or one more, by turns from the seat `first` on."""
    bounds = n_matches * np.arange(n_seats + 1) // n_seats
    return np.roll(np.diff(bounds), first)


def gather(
    folder: SampleFolder[Any], make: MakePlayer, settings: GatherSettings, n_matches: int, n_processes: int,
    report: ReportProgress, should_stop: Callable[[], bool],
) -> bool:  # fmt: skip
    """Have processes of their own add matches, until the folder holds `n_matches`; return whether it does.

    Raises
    ------
    ArenaError
        A process has failed, another command does the same there, or the folder was deleted meanwhile.
    """
    with folder.hold():
        sitting = sum(file.matches for file in folder.files())
        left = max(n_matches - sitting, 0)
        parts = [left * (process + 1) // n_processes - left * process // n_processes for process in range(n_processes)]
        context = multiprocessing.get_context("spawn")
        stop = context.Event()
        workers = [
            context.Process(target=_work, args=(folder, make, settings, process, sitting, part, stop, os.getpid()))
            for process, part in enumerate(parts) if part
        ]  # fmt: skip
        for worker in workers:
            worker.start()
        running = list(workers)
        while running:
            wait([worker.sentinel for worker in running], _LOOK_EVERY_S)
            running = [worker for worker in running if worker.is_alive()]
            try:
                files = folder.files()
            except LostFolderError:
                stop.set()
                raise
            done, samples = sum(file.matches for file in files), sum(file.samples for file in files)
            report(done / n_matches, f"{done:,} matches, {samples:,} samples")
            if should_stop() or any(worker.exitcode for worker in workers):
                stop.set()
        if any(worker.exitcode for worker in workers):
            raise ArenaError(
                f"a process that made {folder.what} has failed; what was written is good, and the same command goes on"
            )
        return sum(file.matches for file in folder.files()) >= n_matches


def _work(
    folder: SampleFolder[Any], make: MakePlayer, settings: GatherSettings, process: int, sitting: int, n_matches: int,
    stop: Event, parent: int,
) -> None:  # fmt: skip
    """Be one of the processes; it ends when the first one says so, or has ended."""
    for number in (signal.SIGINT, signal.SIGTERM):  # which a terminal, or a job's manager, sends to all
        signal.signal(number, signal.SIG_IGN)
    with suppress(LostFolderError):  # which the first process tells
        gather_alone(folder, make, settings, process, sitting, n_matches, lambda: stop.is_set() or os.getppid() != parent)
