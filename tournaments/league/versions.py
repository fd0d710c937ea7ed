"""Versions of an entry: each code that it ever played with, numbered in the order in which they came.

Whatever plays is called by its label: the entry's name for its first version, NAME.2, NAME.3 and so on after it. So a new version
has fixtures, maps and results of its own, and the results of earlier ones stay what they are.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from tournaments.league.entries import is_same_code


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """One version of an entry."""

    entry: str
    number: int
    """From 1."""
    fingerprint: str
    """What tells its code from any other, see `tournaments.league.entries.fingerprint_of`."""
    entered_at: float = 0.0
    """When it came, in seconds since 1970."""
    spec: str = ""
    """What a season plays, as its data folder has it; empty in a league, whose file says it."""
    rating: Mapping[str, Any] | None = None
    """What a season rated it when another version took its place."""

    @property
    def label(self) -> str:
        """What it plays under."""
        return label_of(self.entry, self.number)


def label_of(entry: str, number: int) -> str:
    """Return what a version of an entry plays under."""
    return entry if number == 1 else f"{entry}.{number}"


def entry_of(label: str) -> str:
    """Return the entry that plays under a label."""
    return label.partition(".")[0]


def number_of(label: str) -> int:
    """Return the number of the version that plays under a label."""
    return int(label.partition(".")[2] or 1)


def successions(labels: Iterable[str]) -> list[tuple[str, str]]:
    """Return each two consecutive versions of an entry that are among the labels, the earlier first."""
    known = set(labels)
    of_entry: defaultdict[str, list[int]] = defaultdict(list)
    for label in sorted(known):
        of_entry[entry_of(label)].append(number_of(label))
    return [
        (label_of(entry, before), label_of(entry, after))
        for entry, numbers in of_entry.items()
        for before, after in pairwise(sorted(numbers))
    ]


def match_versions(entries: Mapping[str, str], known: Iterable[Version]) -> list[Version]:
    """Return the version that each entry is now: the one of its code if it has played with that before, else its next.

    Parameters
    ----------
    entries
        The fingerprint of each entry.
    known
        Every version that there was, in any order.
    """
    before: defaultdict[str, list[Version]] = defaultdict(list)
    for version in known:
        before[version.entry].append(version)
    found = []
    for entry, fingerprint in entries.items():
        same = [one for one in before[entry] if is_same_code(one.fingerprint, fingerprint)]
        last = max((one.number for one in before[entry]), default=0)
        found.append(
            replace(same[0], fingerprint=fingerprint) if same else Version(entry=entry, number=last + 1, fingerprint=fingerprint)
        )
    return found


def with_labels(definition: Mapping[str, Any], labels: Mapping[str, str]) -> dict[str, Any]:
    """Return a league's definition with its entries called as their versions are; `labels` is by entry."""
    entries = {labels[entry]: fingerprint for entry, fingerprint in definition["entries"].items()}
    challenger = {"challenger": labels[definition["challenger"]]} if "challenger" in definition else {}
    return {**definition, "entries": entries, **challenger}
