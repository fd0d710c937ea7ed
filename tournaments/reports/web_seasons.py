"""The seasons of a store for the web page: their tables as they were kept, the pages of their entries, and what owners alone see.

`clients.web.providers.Seasons` is what the page asks of them.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from arena.errors import ArenaError, ForgedError, InputError, UnknownNameError
from arena.protocol.page_token import read_page_token
from arena.records.plan import LeagueMatchId
from tournaments.league.season import FINAL_SUFFIX, Phase
from tournaments.ratings.standings import Record
from tournaments.reports.head_to_head import score_interval
from tournaments.reports.replays import find_whole_pairs
from tournaments.reports.season_table import as_season_table
from tournaments.running.scheduler import Folders
from tournaments.store.entry_history import EntryHistory
from tournaments.store.season_store import WAITING, SeasonEntry, Submission
from tournaments.store.store import StoredLeague

MOST_MATCHES = 50
MOST_OPPONENTS = 5
"""Of the best, and of the worst."""
_MOST_SUBMISSIONS = 20
_MOST_LOG_BYTES = 20_000
_RATING = ("elo", "elo_low", "elo_high", "matches")
NOT_THE_OWNER = "only the owner of an entry sees more of it: arena submit --status prints a link that opens this page for them"


class Seasons:
    """The seasons of a data folder, opened anew for each question: a store that is not there yet may come."""

    def __init__(self, data: Path, db: str, clock: Callable[[], float] = time.time) -> None:
        self._folders = Folders(data=data)
        self._db = db or str(data / "arena.db")
        self._clock = clock

    def names(self) -> list[str]:
        """Return the names of all seasons, the one that was run last first; none if there is no store."""
        try:
            with self._open() as store:
                return [league.name for league in store.leagues() if league.is_season]
        except InputError:
            return []

    def season(self, name: str) -> dict[str, Any]:
        """Return the table of a season as it was kept last, its rows as `leaderboard`, and its `final` once that has begun."""
        with self._open() as store:
            document = store.standings(_find(store, name))
            final = store.find(name + FINAL_SUFFIX)
        if document is None:
            return {"season": name, "leaderboard": None}
        facts = {key: value for key, value in document.items() if key != "rows"}
        if final is not None and facts["phase"] in (Phase.FINAL, Phase.OVER):
            facts["final"] = final.name
        return {**facts, "leaderboard": as_season_table(document["rows"])}

    def entry(self, name: str, entry: str) -> dict[str, Any]:
        """Return the versions of an entry with their ratings, its last matches, and whom it scored best and worst against.

        While the table is frozen, it says no more than the table.
        """
        with self._open() as store:
            league = _find(store, name)
            found = store.find_entry(league, entry)
            if found is None:
                raise UnknownNameError(f"entry of season {name}", entry, [one.entry for one in store.entries(league)])
            document = store.standings(league) or {"rows": []}
            is_frozen = document.get("phase") == Phase.FROZEN
            row = next((row for row in document["rows"] if row["entry"] == entry), None)
            versions = _tell_versions(store, league, found, row, is_frozen=is_frozen)
            history = {} if is_frozen else _tell_history(store, league, found)
        return {
            "season": name,
            "entry": entry,
            "plays": None if found.is_withdrawn else found.number,
            "row": row,
            "versions": versions,
            "is_frozen": is_frozen,
            **history,
        }

    def own(self, name: str, entry: str, token: str, host: str) -> dict[str, Any]:
        """Return what the owner of an entry may see of it: its place in the queue, what checks found, its log and its matches.

        Parameters
        ----------
        host
            By which the page was asked, port and all.

        Raises
        ------
        ArenaError
            The token is not its owner's: in the same words, whatever is wrong with it, and whether or not there is such an entry.
        """
        try:
            owner = read_page_token(token, host, name, self._clock())
        except ForgedError:
            raise ArenaError(NOT_THE_OWNER) from None
        with self._open() as store:
            league = store.find(name)
            found = None if league is None else store.find_entry(league, entry)
            own = [] if league is None else store.submissions(league, entry=entry, owner=owner, most=_MOST_SUBMISSIONS)
            if league is None or (found.owner != owner if found is not None else not own):
                raise ArenaError(NOT_THE_OWNER)
            waiting = [one for one in own if one.state == WAITING]
            return {
                "entry": entry,
                "queue": store.queue_position(league, waiting[0]) if waiting else None,
                "submissions": [_tell_submission(one) for one in reversed(own)],
                "log": "" if found is None else self._read_log(name, found.label),
                **({} if found is None else _tell_history(store, league, found)),
            }

    def _read_log(self, name: str, label: str) -> str:
        """Return the end of what an entry's current version wrote while it played."""
        try:
            with (self._folders.journals(name) / f"{label}.log").open("rb") as log:
                log.seek(max(log.seek(0, 2) - _MOST_LOG_BYTES, 0))
                return log.read().decode("utf-8", "replace")
        except FileNotFoundError:
            return ""
        except OSError as error:
            return f"the log cannot be read: {error.strerror}"

    def _open(self) -> EntryHistory:
        return EntryHistory(self._db, make=False)


def check_journal_is_open(store: EntryHistory, league: StoredLeague, identity: str) -> None:
    """Refuse a match of a season whose journal may not be seen: not before its pair is over, and not while the table is frozen.

    Raises
    ------
    ArenaError
        It may not be seen; the sentence says why.
    """
    try:
        match = LeagueMatchId.parse(identity)
    except ValueError:
        match = None
    if match is None or match.league != league.name or identity not in store.find_played([identity]):
        raise ArenaError(f"season {league.name} has no match {identity} that is over")
    if (store.standings(league) or {}).get("phase") == Phase.FROZEN:
        raise ArenaError("the table of the season is frozen, and so long no journal is to be seen")
    if identity not in find_whole_pairs(store.find_played(_pair_of(identity))):
        raise ArenaError("the journal is not to be seen until both matches of its pair are over")


def _find(store: EntryHistory, name: str) -> StoredLeague:
    league = store.find(name)
    if league is None or not league.is_season:
        raise UnknownNameError("season", name, [one.name for one in store.leagues() if one.is_season])
    return league


def _pair_of(identity: str) -> list[str]:
    """Return the two matches of the pair of one."""
    match = LeagueMatchId.parse(identity)
    return [f"{match.pair_id}/{blue}-blue/{match.repeat}" for blue in (match.one, match.other)]


def _tell_versions(
    store: EntryHistory, league: StoredLeague, entry: SeasonEntry, row: Mapping[str, Any] | None, *, is_frozen: bool
) -> list[dict[str, Any]]:
    told = []
    for version in store.versions(league, entry.entry):
        is_shown = row is not None and row["version"] == version.number
        rating = row if is_shown else version.rating
        if is_frozen and not is_shown:
            rating = None  # it may have been rated after the table froze, an earlier one too that was played again
        told.append(
            {
                "number": version.number,
                "entered_at": version.entered_at,
                "rating": None if rating is None else {key: rating[key] for key in _RATING},
            }
        )
    return told


def _tell_history(store: EntryHistory, league: StoredLeague, entry: SeasonEntry) -> dict[str, Any]:
    labels = [version.label for version in store.versions(league, entry.entry)]
    outcomes = store.matches_of(league, labels, MOST_MATCHES)
    visible = find_whole_pairs(store.find_played({one for each in outcomes for one in _pair_of(each.identity)}))
    best, worst = _rank_opponents(store.records_against(league, entry.label))
    return {
        "matches": [
            {
                "identity": each.identity,
                "blue": each.blue,
                "red": each.red,
                **each.result.to_dict(),
                "is_visible": each.identity in visible,
            }
            for each in outcomes
        ],
        "best": best,
        "worst": worst,
    }


def _rank_opponents(records: Mapping[str, Record]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return against whom an entry scored best and worst, by the ends of the scores' intervals: a single match shows little."""
    told = []
    for opponent, record in records.items():
        score = record.score or 0.0
        low, high = score_interval(score, record.n_matches / 2)
        told.append({"opponent": opponent, **asdict(record), "score": score, "low": low, "high": high})
    half = min(MOST_OPPONENTS, (len(told) + 1) // 2)
    best = sorted(told, key=lambda one: (-one["low"], one["opponent"]))[:half]
    rest = [one for one in told if one not in best]
    return best, sorted(rest, key=lambda one: (one["high"], one["opponent"]))[:half]


def _tell_submission(one: Submission) -> dict[str, Any]:
    lines: Sequence[str] = (one.report or {}).get("text", ())
    return {
        "received_at": one.received_at,
        "state": one.state,
        "says": one.says,
        "number": one.number,
        "n_bytes": one.n_bytes,
        "digest": one.digest,
        "lines": [str(line) for line in lines],
    }
