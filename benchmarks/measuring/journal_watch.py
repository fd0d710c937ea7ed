"""The journals of a pit while it plays: which grow, and how many turns were late so far."""

import time
from pathlib import Path

from arena.errors import ArenaError
from arena.files import read_file
from arena.records.framing import CutShortError
from arena.records.journal import Mark, identity_of, read_journal, whole_part

_QUIET_S = 150.0
"""A journal that has not grown for so long is of a match that is over."""


class JournalWatch:
    """What is seen of a pit's matches from outside, by looking at the folder of its journals."""

    def __init__(self, journals: Path) -> None:
        self._journals = journals
        self._sizes: dict[str, int] = {}
        self._grown_at_s: dict[str, float] = {}
        self._late: dict[str, tuple[int, int]] = {}
        """Late turns by journal, and how long it was when they were counted."""

    @property
    def seen(self) -> set[str]:
        """Names of all journals that ever were there."""
        return set(self._sizes)

    def look(self) -> set[str]:
        """Return the identities of the matches whose journals grew since the last look."""
        grown, now_s = set(), time.monotonic()
        for path in self._journals.glob("*.journal"):
            if now_s - self._grown_at_s.get(path.name, now_s) > _QUIET_S:
                continue
            try:
                n_bytes = path.stat().st_size
            except FileNotFoundError:
                continue
            if n_bytes > self._sizes.get(path.name, 0):
                grown.add(identity_of(path.name))
                self._grown_at_s[path.name] = now_s
            self._sizes[path.name] = n_bytes
        return grown

    def count_late(self) -> int:
        """Return how many turns were late so far; what grew since the last count is read."""
        for name, n_bytes in self._sizes.items():
            if self._late.get(name, (0, 0))[1] != n_bytes:
                self._late[name] = _count_late(self._journals / name), n_bytes
        return sum(n for n, _ in self._late.values())


def _count_late(path: Path) -> int:
    try:
        journal = read_journal(whole_part(read_file(path)))
    except (CutShortError, ArenaError, OSError):
        return 0  # it has only begun
    return sum(bool(mark & Mark.LATE) for tick in journal.ticks for mark in tick.marks)
