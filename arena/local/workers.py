"""Other processes that work for this one: they print to stderr, and end when it does, or when it no longer wants what they do."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeVar

from arena import current_call
from arena.errors import ArenaError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

R = TypeVar("R")
_LAST_WORDS_S = 1.0
_mouth: "Connection | None" = None
"""In a worker, by which it says something to its parent."""


def work(
    jobs: Sequence[Callable[[], R]], n_workers: int, on_word: Callable[[tuple[Any, ...]], None] | None = None
) -> Iterator[R]:
    """Do jobs in `n_workers` processes, and yield what each returns as it is done, in no promised order.

    What a job says meanwhile, by `tell`, is handed to `on_word`, in another thread; all of it before the last is yielded.

    Whoever leaves the iteration early, by Ctrl-C or otherwise, waits for none of them.

    Raises
    ------
    ArenaError
        A worker died.
    """
    strangers = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    workers: set[multiprocessing.process.BaseProcess] = set()
    ears, mouth = context.Pipe(duplex=False)
    listener = threading.Thread(target=_listen, args=(ears, on_word), daemon=True)
    with TemporaryDirectory(prefix="arena-", ignore_cleanup_errors=True) as folder:
        pool = ProcessPoolExecutor(n_workers, mp_context=context, initializer=_begin, initargs=(folder, mouth))
        try:
            with _deaf_to_interrupts():
                running = [pool.submit(job) for job in jobs]
            workers = set(multiprocessing.active_children()) - strangers
            mouth.close()
            listener.start()
            for done in as_completed(running):
                yield done.result()
        except BrokenProcessPool as error:
            raise ArenaError("a worker died: a fighter ended its process, or the machine ran out of memory") from error
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                for where in current_call.look(folder, [worker.pid for worker in workers if worker.pid]):
                    error.add_note(where)
            for worker in workers:
                worker.terminate()
            raise
        finally:
            pool.shutdown()
            current_call.end_groups(folder)  # a program that loops does not see that its worker has ended
            if listener.is_alive():
                listener.join(_LAST_WORDS_S)  # for a fighter may have left a process behind that holds the pipe


def tell(words: tuple[Any, ...]) -> None:
    """Say something, in few words, to whoever started this worker."""
    if _mouth is not None:
        _mouth.send(words)  # in one piece, as long as that is short: workers share the pipe


def _listen(ears: "Connection", on_word: Callable[[tuple[Any, ...]], None] | None) -> None:
    with ears, suppress(EOFError):
        while True:
            words = ears.recv()
            if on_word is not None:
                on_word(words)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, which a terminal sends to all: this process hears it, and ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(folder: str, mouth: "Connection") -> None:
    """Prepare a worker: what fighters print goes to stderr, it shows where they are, and its parent's death is its own."""
    global _mouth  # noqa: PLW0603 - of this process
    _mouth = mouth
    os.dup2(2, 1)
    current_call.mark_prints()
    current_call.be_watched(folder)
    follow_parent()


def follow_parent() -> None:
    """End this process, which `multiprocessing` started, as soon as its parent has ended, however it did."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGKILL)
