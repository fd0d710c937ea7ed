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

from arena.bot_calls.groups import end_groups, end_noted, share_groups
from arena.bot_calls.marked_output import mark_prints
from arena.bot_calls.stacks import describe_stacks, share_stack
from arena.errors import ArenaError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.synchronize import Lock

R = TypeVar("R")
_LAST_MESSAGES_S = 1.0
_to_parent: "tuple[Connection, Lock] | None" = None
"""Of a worker: for messages to its parent, and held while one is sent, for workers share the pipe."""


def work(
    jobs: Sequence[Callable[[], R]], n_workers: int, on_message: Callable[[tuple[Any, ...]], None] | None = None
) -> Iterator[R]:
    """Do jobs in `n_workers` processes, and yield what each returns as it is done, in no promised order.

    What a job sends meanwhile, by `send_to_parent`, is handed to `on_message`, in another thread; all of it before the last is
    yielded.

    Whoever leaves the iteration early, by Ctrl-C or otherwise, waits for none of them.

    Raises
    ------
    ArenaError
        A worker died.
    """
    strangers = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    workers: set[multiprocessing.process.BaseProcess] = set()
    receiver, sender = context.Pipe(duplex=False)
    listener = threading.Thread(target=_listen, args=(receiver, on_message), daemon=True)
    with TemporaryDirectory(prefix="arena-", ignore_cleanup_errors=True) as folder:
        pool = ProcessPoolExecutor(n_workers, mp_context=context, initializer=_begin, initargs=(folder, sender, context.Lock()))
        try:
            with _interrupts_blocked():
                running = [pool.submit(job) for job in jobs]
            workers = set(multiprocessing.active_children()) - strangers
            sender.close()
            listener.start()
            for done in as_completed(running):
                yield done.result()
        except BrokenProcessPool as error:
            raise ArenaError("a worker died: a fighter ended its process, or the machine ran out of memory") from error
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                for where in describe_stacks(folder, [worker.pid for worker in workers if worker.pid]):
                    error.add_note(where)
            for worker in workers:
                worker.terminate()
            raise
        finally:
            pool.shutdown()
            end_groups(folder)  # a program that loops does not see that its worker has ended
            if listener.is_alive():
                listener.join(_LAST_MESSAGES_S)  # for a fighter may have left a process behind that holds the pipe


def send_to_parent(message: tuple[Any, ...]) -> None:
    """Send a message to the process that started this worker."""
    if _to_parent is not None:
        sender, lock = _to_parent
        with lock:
            sender.send(message)


def _listen(receiver: "Connection", on_message: Callable[[tuple[Any, ...]], None] | None) -> None:
    with receiver, suppress(EOFError):
        while True:
            message = receiver.recv()
            if on_message is not None:
                on_message(message)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Start processes that Ctrl-C, which a terminal sends to all, does not interrupt: this process is, and ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(folder: str, sender: "Connection", lock: "Lock") -> None:
    """Prepare a worker: what fighters print goes to stderr, it shares their stacks, and its parent's death is its own."""
    global _to_parent  # noqa: PLW0603 - of this process
    _to_parent = sender, lock
    os.dup2(2, 1)
    mark_prints()
    share_stack(folder)
    share_groups(folder)
    follow_parent()


def follow_parent() -> None:
    """End this process, which `multiprocessing` started, as soon as its parent has ended, however it did."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        end_noted()
        os.kill(os.getpid(), signal.SIGKILL)
