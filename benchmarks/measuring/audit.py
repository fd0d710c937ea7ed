"""Whether a ladder and a league kept what they promise: every match stored once, every journal true, none lost."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from arena.errors import ArenaError
from arena.game.types import Termination
from arena.pit.ladder import is_of_ladder
from arena.records.journal import Journal, journal_name
from arena.records.journal_folder import load_journal
from arena.records.verification import check_seals
from tournaments.ladder.ladder_store import LadderStore
from tournaments.store.store import Store


@dataclass(frozen=True, slots=True)
class Audit:
    """What was counted, and in sentences which promises were broken."""

    figures: dict[str, Any]
    broken: list[str]


def audit_ladder(data: Path, pit: str, seen: set[str]) -> Audit:
    """Count the matches of a pit that has closed.

    Parameters
    ----------
    seen
        Names of the journals that were ever there.
    """
    journals, broken = _read_all(data / "journals", seen)
    ended = {one.header.identity: one for one in journals if one.ending is not None}
    played = {identity for identity in ended if is_of_ladder(identity, pit)}
    with LadderStore(str(data / "arena.db"), make=False) as store:
        counted = store.counted(pit)
        n_rated = sum(entry.wins + entry.draws + entry.losses for entry in store.entries(pit))
    if played - counted:
        broken.append(f"{len(played - counted)} matches ended and are not in the store, such as {min(played - counted)}")
    n_valid = sum(one.ending is not None and one.ending.ending is not Termination.VOID for one in ended.values())
    if n_rated != 2 * n_valid:
        broken.append(f"{n_valid} matches changed {n_rated} ratings, which ought to be {2 * n_valid}")
    figures = {
        "matches": len(ended),
        "unfinished": len(journals) - len(ended),
        "stored": len(counted),
        "endings": _count_endings(journals),
    }
    return Audit(figures, broken)


def audit_league(data: Path, db: str, name: str, n_planned: int, seen: set[str]) -> Audit:
    """Count the matches of a league that has ended; as `audit_ladder` does."""
    folder = data / "journals" / name
    journals, broken = _read_all(folder, seen)
    by_identity = {one.header.identity: one for one in journals}
    with Store(db, make=False) as store:
        outcomes = store.outcomes(store.get(name))
    twice = [identity for identity, n in Counter(outcome.identity for outcome in outcomes).items() if n > 1]
    if twice:
        broken.append(f"{len(twice)} matches are in the store twice, such as {min(twice)}")
    if len(outcomes) != n_planned:
        broken.append(f"{len(outcomes)} matches are stored of {n_planned} that were to be played")
    for outcome in outcomes:
        journal = by_identity.get(outcome.identity)
        if journal is None or journal.ending != outcome.result:
            broken.append(f"{outcome.identity} ended otherwise in the store than in {journal_name(outcome.identity)}")
    figures = {"matches": n_planned, "stored": len(outcomes), "endings": _count_endings(journals)}
    return Audit(figures, broken)


def _read_all(folder: Path, seen: set[str]) -> tuple[list[Journal], list[str]]:
    """Return the journals that hold, each played again, and in sentences what was wrong with others."""
    journals, broken = [], []
    paths = {path.name: path for path in folder.glob("*.journal")}
    for name in sorted(seen - paths.keys()):
        broken.append(f"the journal {name} is gone")
    for name, path in sorted(paths.items()):
        try:
            journal = load_journal(path)
            checked = check_seals(journal)  # which plays it again
        except ArenaError as error:
            broken.append(f"the journal {name} does not hold: {error}")
            continue
        if checked is None or not checked.is_sound:
            broken.append(f"the journal {name} has a signature that does not hold")
        journals.append(journal)
    return journals, broken


def _count_endings(journals: list[Journal]) -> dict[str, int]:
    return dict(Counter(one.ending.ending.name.lower() for one in journals if one.ending is not None))
