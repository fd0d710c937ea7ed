"""How many sessions a router takes: as many as this process may have files open, less those that its matches need."""

import resource
from typing import NamedTuple

from arena.errors import InputError

MOST_SESSIONS = 2_048
"""An idle session costs 42 kB."""
MOST_PENDING = 128
LEAST_FILES = 256
_OWN_FILES = 64
"""Of the process itself: its libraries, its listeners, its store."""
_JOURNALS = 264
"""Of the matches of a pit, and of those that begin next."""
_MOST_FILES = 16_384


class Capacity(NamedTuple):
    """How many connections a router takes."""

    sessions: int
    pending: int
    """Connections that have still to say who they are."""


def find_capacity() -> Capacity:
    """Raise this process's limit on open files as far as it may, and return how many connections a router can take under it.

    A session is a file, and so is a journal: strangers who only connect must leave room for the matches of those who play.

    Raises
    ------
    InputError
        The limit is too low for a pit, or cannot be raised.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, _MOST_FILES)
    n_files = most if soft == resource.RLIM_INFINITY else max(soft, most)
    if soft != resource.RLIM_INFINITY and n_files > soft:
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (n_files, hard))
        except (OSError, ValueError) as error:
            raise InputError(
                f"the limit on open files cannot be raised to {n_files} ({error}); set it by ulimit -n 1024"
            ) from error
    if n_files < LEAST_FILES:
        raise InputError(
            f"a pit needs {LEAST_FILES} open files at least, and may have {n_files}; raise the limit: ulimit -n 1024"
        )
    pending = min(MOST_PENDING, n_files // 8)
    return Capacity(min(n_files - _OWN_FILES - pending - min(_JOURNALS, n_files // 4), MOST_SESSIONS), pending)
