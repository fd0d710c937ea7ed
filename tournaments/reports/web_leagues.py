"""The leagues and ladders of a store for the web page: their reports, live, and the journals that may be seen.

`clients.web.providers.Leagues` is what the page asks of them.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

from arena.errors import ArenaError, InputError, UnknownNameError
from arena.records.journal import read_journal
from arena.records.journal_folder import JournalFolder
from tournaments.ladder.ladder_store import LadderStore
from tournaments.outcome import Outcome
from tournaments.reports.head_to_head import head_to_head
from tournaments.reports.ladder_table import describe_ladder
from tournaments.reports.leaderboard import as_web_table
from tournaments.reports.replays import find_visible, read_kept
from tournaments.reports.report import make_report, to_document
from tournaments.reports.tags import Course, read_course, tag_course, tag_results
from tournaments.reports.web_seasons import check_journal_is_open
from tournaments.running.duel import judge
from tournaments.running.scheduler import Folders
from tournaments.store.entry_history import EntryHistory

_N_DRAWS = 200
"""Of the intervals while a league runs, when they are drawn anew after every match; then as many as in its report."""


class Leagues:
    """The leagues of a data folder, opened anew for each question: a store that is not there yet may come."""

    def __init__(self, data: Path, db: str) -> None:
        self._folders = Folders(data=data)
        self._db = db or str(data / "arena.db")
        self._reports: dict[str, tuple[tuple[object, ...], dict[str, Any]]] = {}
        """By league: its hash, its pairs, its secret if that is known, how many results it had, and what was reported of them."""
        self._kept: dict[str, JournalFolder] = {}
        """By league."""
        self._courses: dict[tuple[str, str], Course] = {}
        """By league and match: what tags need of its journal."""

    def names(self) -> list[str]:
        """Return the names of all leagues, the one that was run last first; none if there is no store."""
        try:
            with self._open() as store:
                return [league.name for league in store.leagues() if not league.is_season]
        except InputError:
            return []

    def report(self, name: str) -> dict[str, Any]:
        """Return the document of a league's report, with its `leaderboard`, and under `results` its matches, pair by pair."""
        with self._open() as store:
            league = store.get(name)
            if league.is_season:
                raise InputError(f"{name} is a season: its page is /seasons/{name}")
            state = league.hash, league.n_pairs, league.secret, store.count(league)
            before, document = self._reports.get(name, ((), {}))
            if before == state:
                return document
            outcomes = store.outcomes(league)
        report = make_report(league, outcomes, n_draws=_N_DRAWS)
        if report.is_complete:
            report = make_report(league, outcomes)
        document = {**to_document(report), "leaderboard": as_web_table(report.standings.rows)}
        document["results"] = [{"identity": one.identity, "blue": one.blue, "red": one.red} for one in outcomes]
        self._reports[name] = (*state[:-1], len(outcomes)), document
        return document

    def head_to_head(self, name: str, one: str, other: str) -> dict[str, Any]:
        """Return how two entries of a league fared against each other; tags that need a journal once it may be seen."""
        report = self.report(name)
        elo = {row["entry"]: row["elo"] for row in report["standings"]}
        for entry in (one, other):
            if entry not in elo:
                raise UnknownNameError("entry", entry, elo)
        with self._open() as store:
            league = store.get(name)
            outcomes = tuple(league.current(store.outcomes(league)))
        test = judge(league.definition, outcomes)
        outcomes = outcomes if test is None else test.outcomes
        tags = tag_results(outcomes, elo)
        visible = find_visible((each.identity for each in outcomes), league.n_pairs, is_complete=report["matches"]["complete"])
        for outcome in outcomes:
            if {outcome.blue, outcome.red} == {one, other} and outcome.identity in visible:
                with suppress(ArenaError):  # its journal is gone, or does not hold, as its replay says
                    tags.setdefault(outcome.identity, []).extend(self._tag_course(name, outcome))
        return {"league": name, **head_to_head(outcomes, one, other, tags)}

    def _tag_course(self, name: str, outcome: Outcome) -> list[str]:
        key = name, outcome.identity
        if key not in self._courses:
            self._courses[key] = read_course(read_journal(read_kept(self._journals(name), outcome.identity)))
        return tag_course(outcome.result, self._courses[key])

    def ladders(self) -> list[str]:
        """Return the names of all ladders, the one that was played on last first; none if there is no store."""
        try:
            with LadderStore(self._db, make=False) as store:
                return store.ladders()
        except InputError:
            return []

    def ladder(self, name: str) -> dict[str, Any]:
        """Return the standings of a ladder, and its `leaderboard` as that of a league."""
        return describe_ladder(self._db, name)

    def journal(self, name: str, identity: str) -> bytes:
        """Return the journal of a match, once all matches of its two entries are over: another may be on its map.

        A test that is decided needs no more of them, but the pair of the match must be whole; nor does a season.
        """
        with self._open() as store:
            league = store.get(name)
            if league.is_season:
                check_journal_is_open(store, league, identity)
                return read_kept(self._journals(name), identity)
            played = store.identities(league)
        if identity not in played:
            raise ArenaError(f"league {name} has no match {identity} that is over")
        visible = find_visible(played, league.n_pairs, is_complete=False)
        if identity not in visible and self.report(name)["matches"]["complete"]:
            visible = find_visible(played, league.n_pairs, is_complete=True)
        if identity not in visible:
            raise ArenaError("the journal is not to be seen until the last match of these two is over")
        return read_kept(self._journals(name), identity)

    def _journals(self, name: str) -> JournalFolder:
        return self._kept.setdefault(name, JournalFolder(self._folders.journals(name)))

    def _open(self) -> EntryHistory:
        return EntryHistory(self._db, make=False)
