"""The lock that keeps two schedulers off one league; a file's, which dies with the process that holds it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from arena.errors import ArenaError, InputError


class TakenError(ArenaError):
    """Another scheduler runs the league."""

    def __init__(self, league: str, holds: str) -> None:
        super().__init__(f"another scheduler runs league {league} (it holds {holds})")
        self.league = league


@contextmanager
def lock_file(path: Path, league: str) -> Iterator[None]:
    """Hold a file of a league; it is made if need be.

    Raises
    ------
    TakenError
        Another scheduler holds it.
    """
    lock = FileLock(path, timeout=0, mode=0o600)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout as error:
        raise TakenError(league, str(path)) from error
    except OSError as error:
        raise InputError(f"cannot lock the league with {path}: {error.strerror}") from error
    try:
        yield
    finally:
        lock.release()
