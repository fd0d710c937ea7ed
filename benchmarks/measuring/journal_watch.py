"""The journals of a pit while it plays: which grow, and how many turns were late so far."""

import os
import time
from pathlib import Path

from arena.errors import ArenaError
from arena.files import read_file
from arena.records.framing import CutShortError
from arena.records.journal import SUFFIX, Journal, Mark, identity_of, journal_name, read_journal, whole_part

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
        names = os.listdir(self._journals) if self._journals.exists() else []  # noqa: PTH208  # thousands, many times a second
        for name in names:
            if not name.endswith(SUFFIX) or now_s - self._grown_at_s.get(name, now_s) > _QUIET_S:
                continue
            try:
                n_bytes = (self._journals / name).stat().st_size
            except FileNotFoundError:
                continue
            if n_bytes > self._sizes.get(name, 0):
                grown.add(identity_of(name))
                self._grown_at_s[name] = now_s
            self._sizes[name] = n_bytes
        return grown

    def played_within(self, most_s: float) -> list[str]:
        """Return the identities of the matches whose journals were seen to grow of late."""
        since_s = time.monotonic() - most_s
        return [identity_of(name) for name, at_s in self._grown_at_s.items() if at_s > since_s]

    def has_ended(self, identity: str) -> bool:
        """Return whether the journal of a match has its ending."""
        journal = _read(self._journals / journal_name(identity))
        return journal is not None and journal.ending is not None

    def count_late(self) -> int:
        """Return how many turns were late so far; what grew since the last count is read."""
        for name, n_bytes in self._sizes.items():
            if self._late.get(name, (0, 0))[1] != n_bytes:
                self._late[name] = _count_late(self._journals / name), n_bytes
        return sum(n for n, _ in self._late.values())


def _count_late(path: Path) -> int:
    journal = _read(path)
    ticks = [] if journal is None else journal.ticks
    return sum(bool(mark & Mark.LATE) for tick in ticks for mark in tick.marks)


def _read(path: Path) -> Journal | None:
    try:
        return read_journal(whole_part(read_file(path)))
    except (CutShortError, ArenaError, OSError):
        return None  # it has only begun
