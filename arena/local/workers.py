"""Other processes that work for this one: they print to stderr, and end when it does, or when it no longer wants what they do."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

from arena.errors import ArenaError

R = TypeVar("R")


def work(jobs: Sequence[Callable[[], R]], n_workers: int) -> Iterator[R]:
    """Do jobs in `n_workers` processes, and yield what each returns as it is done, in no promised order.

    Whoever leaves the iteration early, by Ctrl-C or otherwise, waits for none of them.

    Raises
    ------
    ArenaError
        A worker died.
    """
    strangers = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(n_workers, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
    workers: set[multiprocessing.process.BaseProcess] = set()
    try:
        with _deaf_to_interrupts():
            running = [pool.submit(job) for job in jobs]
        workers = set(multiprocessing.active_children()) - strangers
        for done in as_completed(running):
            yield done.result()
    except BrokenProcessPool as error:
        raise ArenaError("a worker died: a fighter ended its process, or the machine ran out of memory") from error
    except BaseException:
        for worker in workers:
            worker.terminate()
        raise
    finally:
        pool.shutdown()


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, which a terminal sends to all: this process hears it, and ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Prepare a worker: what fighters print goes to stderr, and its parent's death is its own."""
    os.dup2(2, 1)
    follow_parent()


def follow_parent() -> None:
    """End this process, which `multiprocessing` started, as soon as its parent has ended, however it did."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGKILL)
