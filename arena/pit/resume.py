"""Matches that a pit left unfinished: found by their journals, played again up to where they stood."""

import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from arena.errors import JournalError
from arena.game.types import Team
from arena.match.effects import Event
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.records.journal import read_journal, whole_part

logger = logging.getLogger(__name__)


def resume_matches(
    journals: Path, time_control: TimeControl, now_s: float, wanted: Callable[[str], bool]
) -> Iterator[tuple[Match, dict[Team, bytes], list[Event], int]]:
    """Yield the unfinished matches whose identity is wanted.

    Yields
    ------
    tuple
        The match at its very tick; the public keys of who plays it; the events that are due at once, if its last tick was its
        last; its journal, open for appending, without a record that was cut short.
    """
    for path in sorted(journals.glob("*.journal")):
        try:
            whole = whole_part(path.read_bytes())
            journal = read_journal(whole)
            if journal.ending is not None or journal.seals is None or not wanted(journal.header.identity):
                continue
            match = Match(journal.header, time_control, now_s)
            events = match.recover(journal)
        except JournalError as error:
            logger.warning("%s cannot be resumed: %s", path.name, error)
            continue
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND)
        os.ftruncate(descriptor, len(whole))
        logger.info("resumed %s at tick %d", journal.header.identity, match.tick)
        yield match, journal.seals.entries, events, descriptor
