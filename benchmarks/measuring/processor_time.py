"""What processes have spent of the processor, in their own threads and in Zenoh's: a busy machine hardly changes it."""

from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

_ZENOH = {"acc", "app", "net", "rx", "tx"}
"""What Zenoh calls its threads, a number apart."""


class Spent(NamedTuple):
    """Seconds of processor time since some process began."""

    own_s: float = 0.0
    """Of the threads that run Python; a put that Zenoh carries out for them is among it."""
    zenoh_s: float = 0.0
    """Of Zenoh's threads."""

    @property
    def total_s(self) -> float:
        """Of all threads."""
        return self.own_s + self.zenoh_s

    def since(self, before: "Spent") -> "Spent":
        """Return what was spent after `before`."""
        return Spent(self.own_s - before.own_s, self.zenoh_s - before.zenoh_s)


def spent_by(processes: Iterable[int]) -> Spent:
    """Return what processes have spent by now; one that is gone has spent nothing."""
    spent: Counter[bool] = Counter()
    for process in processes:
        for thread in Path(f"/proc/{process}/task").glob("*"):
            try:
                name, n_ns = (thread / "comm").read_text(), int((thread / "schedstat").read_text().split()[0])
            except OSError:
                continue
            spent[name.partition("-")[0] in _ZENOH] += n_ns
    return Spent(own_s=spent[False] / 1e9, zenoh_s=spent[True] / 1e9)


def children_of(parent: int) -> list[int]:
    """Return the processes that a process has started, as far as they run."""
    lines = []
    for thread in Path(f"/proc/{parent}/task").glob("*"):
        with suppress(OSError):
            lines.append((thread / "children").read_text())
    return [int(child) for line in lines for child in line.split()]
