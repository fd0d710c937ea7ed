"""Who plays in a season now: the current version of each entry, whose it is, and how it is loaded."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from arena.protocol.identity import from_text
from policies.workers.files import fighter_in
from tournaments.league.entries import REMOTE
from tournaments.league.league import League
from tournaments.league.versions import Version
from tournaments.store.season_store import ORGANISER, SeasonEntry, SeasonStore
from tournaments.store.store import StoredLeague
from tournaments.venues.setting import Fighter


@dataclass(frozen=True, slots=True, kw_only=True)
class Roster:
    """The entries of a season that play, by their labels."""

    entries: Mapping[str, SeasonEntry]
    fighters: Mapping[str, Fighter]
    think_s: Mapping[str, float]
    """What a turn of each takes, as far as it was measured, in seconds of a core."""
    follows: tuple[tuple[str, str], ...]
    """Each version of these entries that has one after it, and that one, by labels."""

    @property
    def labels(self) -> list[str]:
        """Of all of them, sorted."""
        return sorted(self.entries)


def read_roster(store: SeasonStore, row: StoredLeague, league: League, folder: Path, think_s: Mapping[str, float]) -> Roster:
    """Return who plays now.

    Parameters
    ----------
    folder
        Of the season, where its submissions are.
    think_s
        What is known of turns already, by label.
    """
    playing = [entry for entry in store.entries(row) if not entry.is_withdrawn]
    versions: dict[str, list[Version]] = {}
    for version in store.versions(row):
        versions.setdefault(version.entry, []).append(version)
    fighters, known_s = {}, {}
    for entry in playing:
        if entry.owner == ORGANISER:
            name = entry.entry
            fighters[entry.label] = Fighter(
                spec=league.entries[name], sandbox=league.sandboxes.get(name), public_key=league.remote.get(name)
            )
        else:
            [version] = [one for one in versions[entry.entry] if one.number == entry.number]
            fighters[entry.label] = fighter_of(version, league, folder)
        known = think_s.get(entry.label)
        known_s[entry.label] = _read_think_s(store.find_report(row, entry.entry, entry.number)) if known is None else known
    return Roster(
        entries={entry.label: entry for entry in playing},
        fighters=fighters,
        think_s=known_s,
        follows=tuple((before.label, after.label) for entry in playing for before, after in pairwise(versions[entry.entry])),
    )


def _read_think_s(report: Mapping[str, Any] | None) -> float:
    """Return the median turn of a check; 0 where none was timed."""
    times = None if report is None else report.get("times")
    return 0.0 if times is None else float(times["median_ms"]) / 1_000


def fighter_of(version: Version, league: League, folder: Path) -> Fighter:
    """Return how a version is played that was submitted."""
    if version.spec.startswith(REMOTE):
        return Fighter(spec=version.spec, public_key=from_text(version.spec.removeprefix(REMOTE)))
    return Fighter(spec=fighter_in(folder / version.spec), sandbox=league.strangers_sandbox)
