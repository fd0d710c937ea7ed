"""Matches that ended before their results were stored, read from their journals: none is played twice.

A venue asks for them before it plays, and again when what plays them died: a journal is whole before its result is told.
"""

import logging
from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path

from arena.errors import ArenaError, InputError, JournalError
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.records.framing import CutShortError
from arena.records.journal import Header, Journal, Mark, read_journal, whole_part
from arena.records.journal_folder import JournalFolder, has_journals
from arena.records.plan import MatchPlan
from arena.records.replay import verify
from tournaments.outcome import Outcome, SeatOutcome

logger = logging.getLogger(__name__)


def find_ended(journals: Path, ruleset: Ruleset, plans: Iterable[MatchPlan]) -> Iterator[Outcome]:
    """Yield the results of those plans that have a whole journal; what is cut short, void or not the plan's is left to be played.

    Each journal is played again, so that one that was changed counts for nothing. A journal holds no clock: its result has no
    latencies.

    Raises
    ------
    JournalError
        A bundle in the folder is none, or of a newer format: it may hold what would be played twice.
    """
    kept = JournalFolder(journals)
    for plan in plans:
        if not kept.holds(plan.identity):
            continue
        try:
            outcome = _read(kept, ruleset, plan)
        except ArenaError as error:
            logger.warning("%s is played again: %s", plan.identity, error)
            continue
        if outcome is not None:
            yield outcome


def check_journal(kept: JournalFolder, ruleset: Ruleset, plan: MatchPlan, result: MatchResult) -> None:
    """Play the journal of a match again that has just ended; `ArenaError` if it does not hold, or not with this result."""
    outcome = _read(kept, ruleset, plan)
    if outcome is None or outcome.result != result:
        raise JournalError("it ends otherwise than the match did")


def set_aside(journals: Path) -> None:
    """Move the journals of a league that was edited before it had a result out of the way: its results are not to be read there.

    An entry whose file was edited is the same to a journal, which holds its name alone.
    """
    if not has_journals(journals):
        return
    number = next(number for number in count(1) if not journals.with_name(f"{journals.name}.before-{number}").exists())
    aside = journals.with_name(f"{journals.name}.before-{number}")
    try:
        journals.rename(aside)
    except OSError as error:
        raise InputError(f"cannot move the journals of another league out of {journals}: {error.strerror}") from error
    logger.info("the journals of the league as it was before are in %s", aside)


def _read(kept: JournalFolder, ruleset: Ruleset, plan: MatchPlan) -> Outcome | None:
    """Return how a match ended by its journal; None if it has not, or was void."""
    try:
        journal = read_journal(whole_part(kept.read(plan.identity)))  # a receipt behind the ending may have been cut short
    except CutShortError:
        return None
    except OSError as error:
        raise JournalError(f"its journal cannot be read: {error.strerror}") from error
    if journal.ending is None or journal.ending.ending is Termination.VOID:
        return None
    header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=ruleset, keys=plan.keys)
    if journal.header.pack() != header.pack():
        raise JournalError("its journal is of another match: its entries, rules or keys are not those of the league")
    verify(journal)
    return Outcome.of(plan, journal.ending, {team: SeatOutcome(faults=_count_marks(journal, team)) for team in Team})


def _count_marks(journal: Journal, team: Team) -> dict[str, int]:
    """Return what a seat's turns were ruled, by kind."""
    counts = {str(mark.name).lower(): sum(mark in tick.marks[team] for tick in journal.ticks) for mark in Mark}
    return {kind: n for kind, n in counts.items() if n}
