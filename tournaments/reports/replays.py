"""The journals of a league that may be seen, and the replays that its report carries with it."""

from collections import Counter
from collections.abc import Iterable
from contextlib import suppress

from arena.display.replay_frames import describe_match
from arena.errors import JournalError
from arena.records.journal import journal_name
from arena.records.journal_folder import JournalFolder
from arena.records.plan import LeagueMatchId
from clients.web.page_file import pack
from tournaments.reports.report import Report

MOST_CARRIED = 60
"""Matches of a report that carries their replays, some 6 kB and 50 ms each; a larger report links to their journals alone."""
_MOST_BYTES = 1 << 24


def find_visible(played: Iterable[str], n_pairs: int, is_complete: bool) -> set[str]:
    """Return the matches whose journals may be seen: those of two entries that are not to meet again, maybe on the same map.

    Parameters
    ----------
    is_complete
        Whether the league is over, as a test is that is decided: then a match needs no more than its whole pair.
    """
    fixtures = {identity: LeagueMatchId.parse(identity).fixture for identity in played}
    n_played = Counter(fixtures.values())
    whole = {identity for identity, fixture in fixtures.items() if n_played[fixture] >= 2 * n_pairs}
    return whole | (find_whole_pairs(fixtures) if is_complete else set())


def find_whole_pairs(played: Iterable[str]) -> set[str]:
    """Return the matches whose pair is over, and so its map.

    These are the matches of a season whose journals may be seen: two entries may always meet again there, and on other maps.
    """
    pairs = {identity: LeagueMatchId.parse(identity).pair_id for identity in played}
    n_played = Counter(pairs.values())
    return {identity for identity, pair in pairs.items() if n_played[pair] == 2}


def read_kept(journals: JournalFolder, identity: str) -> bytes:
    """Return the journal of a league's match; `JournalError` if it cannot be read."""
    try:
        return journals.read(identity, _MOST_BYTES)
    except OSError as error:
        raise JournalError(f"the journal {journal_name(identity)} cannot be read: {error.strerror}") from error


def pack_replays(report: Report, journals: JournalFolder) -> dict[str, str]:
    """Return the replays that a report carries, by identity; a match without a journal that may be seen and holds has none."""
    if len(report.outcomes) > MOST_CARRIED:
        return {}
    packed = {}
    for identity in find_visible((one.identity for one in report.outcomes), report.league.n_pairs, report.is_complete):
        with suppress(JournalError):
            packed[identity] = pack(describe_match(read_kept(journals, identity)))
    return packed
