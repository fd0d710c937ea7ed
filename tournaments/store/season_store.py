"""Seasons in the store: who entered what, which version is played, what was submitted, and the table as it stands.

A season is a league whose entries come one by one. What its definition calls entries are the current versions of all that are not
withdrawn; every change of that is one transaction.
"""

import json
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Row, func, insert, select, union_all, update

from arena.game.types import Termination
from tournaments.league.edits import hash_definition
from tournaments.league.versions import Version, label_of, match_versions
from tournaments.outcome import Outcome
from tournaments.store.schema import LEAGUES, MATCHES, SEASON_ENTRIES, SEASON_STANDINGS, SUBMISSIONS, VERSIONS, StoreError
from tournaments.store.store import Store, StoredLeague, check_edit, read_outcome

ORGANISER = ""
"""Owner of the entries that a season's own file names."""
WAITING, ACCEPTED, REFUSED = "waiting", "accepted", "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonEntry:
    """An entry of a season."""

    entry: str
    owner: str
    """Its public key as text."""
    number: int
    """Of the version that plays."""
    is_withdrawn: bool

    @property
    def label(self) -> str:
        """What its current version plays under."""
        return label_of(self.entry, self.number)


@dataclass(frozen=True, slots=True, kw_only=True)
class Submission:
    """Something that an author submitted."""

    id: int
    entry: str
    owner: str
    digest: str
    """SHA-256 (hex) of what came."""
    n_bytes: int
    received_at: float
    """Seconds since 1970."""
    state: str
    """waiting, accepted or refused."""
    says: str
    """What its author is told, in a sentence."""
    report: Mapping[str, Any] | None
    """What the check found."""
    number: int | None
    """Of the version that it became."""


class WithdrawnError(StoreError):
    """A submission was to play that was refused meanwhile, as its owner's withdrawal does."""


class SeasonStore(Store):
    """A store, as seasons see it. Whoever changes a season holds its lock."""

    def open_season(self, name: str, definition: Mapping[str, Any], now_s: float) -> StoredLeague:
        """Return the row of a season that is about to go on, made if need be, with the entries of its file.

        Parameters
        ----------
        definition
            Of the season's file, and under `secret` what binds it to its secret.

        Raises
        ------
        StoreError
            It has results that were played under other rules, another secret or clock.
        """
        before = self.find(name)
        if before is None:
            self.enter(name, {**definition, "entries": {}}, n_pairs=1)
        else:
            check_edit(before, definition, n_pairs=1, has_new=())
        league = self.get(name)
        for taken in self.entries(league):
            if taken.entry in definition["entries"] and taken.owner != ORGANISER:
                raise StoreError(f"season {name} has an entry {taken.entry} of an author; give the one in its file another name")
        known = self.versions(league)
        versions = match_versions(definition["entries"], known)

        def work(connection: Connection) -> None:
            connection.execute(update(LEAGUES).where(LEAGUES.c.id == league.id).values(run_at=now_s))
            for version in versions:
                if version not in known:
                    connection.execute(self._keep_version(league.id, version, now_s))
                self._play_version(connection, league.id, version.entry, ORGANISER, version.number)
            gone = SEASON_ENTRIES.c.entry.not_in(list(definition["entries"]))
            own = (SEASON_ENTRIES.c.league_id == league.id) & (SEASON_ENTRIES.c.owner == ORGANISER)
            connection.execute(update(SEASON_ENTRIES).where(own, gone).values(is_withdrawn=True))
            self._redefine(connection, league)

        self._do("write to", work, name)
        return self.get(name)

    def entries(self, league: StoredLeague) -> list[SeasonEntry]:
        """Return every entry of a season, withdrawn ones too, by name."""
        query = select(SEASON_ENTRIES).where(SEASON_ENTRIES.c.league_id == league.id).order_by(SEASON_ENTRIES.c.entry)
        rows = self._do("read", lambda connection: connection.execute(query).all())
        return [SeasonEntry(entry=row.entry, owner=row.owner, number=row.number, is_withdrawn=row.is_withdrawn) for row in rows]

    def find_entry(self, league: StoredLeague, entry: str) -> SeasonEntry | None:
        """Return an entry of a season by its name."""
        return next((one for one in self.entries(league) if one.entry == entry), None)

    def submit(
        self, league: StoredLeague, *, entry: str, owner: str, digest: str, n_bytes: int, now_s: float, state: str = WAITING
    ) -> Submission:
        """Keep that something was submitted; it waits for its check, or needs none where it is `ACCEPTED` as it comes."""
        row = {
            "league_id": league.id, "entry": entry, "owner": owner, "digest": digest, "n_bytes": n_bytes,
            "received_at": now_s, "state": state, "says": "", "report": None, "number": None,
        }  # fmt: skip

        def work(connection: Connection) -> int:
            found = connection.execute(insert(SUBMISSIONS).values(row).returning(SUBMISSIONS.c.id)).scalar_one()
            return int(found)

        id = self._do("write to", work, league.name)
        return self.submission(league, id)

    def submission(self, league: StoredLeague, id: int) -> Submission:
        """Return a submission by its number."""
        query = select(SUBMISSIONS).where(SUBMISSIONS.c.league_id == league.id, SUBMISSIONS.c.id == id)
        return _submission(self._do("read", lambda connection: connection.execute(query).one()))

    def submissions(
        self, league: StoredLeague, *, state: str | None = None, owner: str | None = None, entry: str | None = None,
        since_s: float | None = None, most: int = 1_000,
    ) -> list[Submission]:  # fmt: skip
        """Return submissions, the first first; the last `most` of them."""
        query = select(SUBMISSIONS).where(SUBMISSIONS.c.league_id == league.id)
        for column, value in (("state", state), ("owner", owner), ("entry", entry)):
            if value is not None:
                query = query.where(SUBMISSIONS.c[column] == value)
        if since_s is not None:
            query = query.where(SUBMISSIONS.c.received_at >= since_s)
        query = query.order_by(SUBMISSIONS.c.id.desc()).limit(most)
        rows = self._do("read", lambda connection: connection.execute(query).all())
        return [_submission(row) for row in reversed(rows)]

    def find_report(self, league: StoredLeague, entry: str, number: int) -> Mapping[str, Any] | None:
        """Return what the check found of a version; None if it was not checked."""
        query = (
            select(SUBMISSIONS.c.report)
            .where(SUBMISSIONS.c.league_id == league.id, SUBMISSIONS.c.entry == entry, SUBMISSIONS.c.number == number)
            .order_by(SUBMISSIONS.c.id.desc())
            .limit(1)
        )
        report = self._do("read", lambda connection: connection.scalar(query))
        return None if report is None else dict(json.loads(report))

    def queue_position(self, league: StoredLeague, waiting: Submission) -> int:
        """Return how manieth a submission is to be checked, from 1."""
        before = (SUBMISSIONS.c.league_id == league.id) & (SUBMISSIONS.c.state == WAITING) & (SUBMISSIONS.c.id < waiting.id)
        query = select(func.count()).select_from(SUBMISSIONS).where(before)
        return 1 + self._do("read", lambda connection: int(connection.scalar(query) or 0))

    def refuse(self, league: StoredLeague, submission: Submission, says: str, report: Mapping[str, Any] | None = None) -> None:
        """Keep why a submission is not played; nothing is changed if it was accepted meanwhile."""
        values = {"state": REFUSED, "says": says, "report": None if report is None else json.dumps(report)}
        change = update(SUBMISSIONS).where(SUBMISSIONS.c.id == submission.id, SUBMISSIONS.c.state != ACCEPTED).values(values)
        self._do("write to", lambda connection: connection.execute(change), league.name)

    def accept(
        self,
        league: StoredLeague,
        submission: Submission,
        *,
        spec: str,
        says: str,
        report: Mapping[str, Any] | None,
        now_s: float,
    ) -> Version:
        """Enter what was submitted as the version that its entry plays from now on; code that it played before is that version.

        Parameters
        ----------
        spec
            How it is loaded, see `Version.spec`.

        Raises
        ------
        WithdrawnError
            It was refused meanwhile.
        """
        [version] = match_versions(
            {submission.entry: submission.digest},
            self.versions(league, submission.entry),
        )
        values = {
            "state": ACCEPTED, "says": says, "number": version.number,
            "report": None if report is None else json.dumps(report),
        }  # fmt: skip
        entered = Version(entry=version.entry, number=version.number, fingerprint=submission.digest, spec=spec)

        change = update(SUBMISSIONS).where(SUBMISSIONS.c.id == submission.id, SUBMISSIONS.c.state != REFUSED).values(values)

        def work(connection: Connection) -> bool:
            if connection.execute(change.returning(SUBMISSIONS.c.id)).one_or_none() is None:
                return False
            connection.execute(self._keep_version(league.id, entered, now_s))
            self._play_version(connection, league.id, submission.entry, submission.owner, version.number)
            self._redefine(connection, league)
            return True

        if not self._do("write to", work, league.name):
            raise WithdrawnError(f"what was submitted as {submission.entry} was withdrawn, or refused, and cannot play")
        return entered

    def play_version(self, league: StoredLeague, entry: SeasonEntry, number: int) -> None:
        """Have an entry play a version that it has had, whether it was withdrawn or not."""

        def work(connection: Connection) -> None:
            self._play_version(connection, league.id, entry.entry, entry.owner, number)
            self._redefine(connection, league)

        self._do("write to", work, league.name)

    def withdraw(self, league: StoredLeague, entry: SeasonEntry) -> None:
        """Let an entry play no more; its results stay."""

        def work(connection: Connection) -> None:
            row = (SEASON_ENTRIES.c.league_id == league.id) & (SEASON_ENTRIES.c.entry == entry.entry)
            connection.execute(update(SEASON_ENTRIES).where(row).values(is_withdrawn=True))
            self._redefine(connection, league)

        self._do("write to", work, league.name)

    def keep_rating(self, league: StoredLeague, entry: str, number: int, rating: Mapping[str, Any]) -> None:
        """Keep what a version was rated when it was played last."""
        row = (VERSIONS.c.league_id == league.id) & (VERSIONS.c.entry == entry) & (VERSIONS.c.number == number)
        change = update(VERSIONS).where(row).values(rating=json.dumps(rating))
        self._do("write to", lambda connection: connection.execute(change), league.name)

    def count_results(self, league: StoredLeague) -> dict[tuple[str, str], tuple[int, int, int]]:
        """Return how often blue won, drew and lost, by the labels of blue and red."""
        query = (
            select(MATCHES.c.blue, MATCHES.c.red, MATCHES.c.winner, func.count())
            .where(MATCHES.c.league_id == league.id)
            .group_by(MATCHES.c.blue, MATCHES.c.red, MATCHES.c.winner)
        )
        found: dict[tuple[str, str], list[int]] = {}
        for blue, red, winner, n in self._do("read", lambda connection: connection.execute(query).all()):
            found.setdefault((blue, red), [0, 0, 0])[{"blue": 0, None: 1, "red": 2}[winner]] += n
        return {pair: (won, drawn, lost) for pair, (won, drawn, lost) in found.items()}

    def count_forfeits(self, league: StoredLeague) -> dict[str, int]:
        """Return how many matches each label has forfeited."""
        forfeited = (MATCHES.c.league_id == league.id) & (MATCHES.c.ending == Termination.FORFEIT.name.lower())
        sides = [
            select(loser, func.count()).where(forfeited, MATCHES.c.winner == winner).group_by(loser)
            for loser, winner in ((MATCHES.c.blue, "red"), (MATCHES.c.red, "blue"))
        ]
        found: Counter[str] = Counter()

        def work(connection: Connection) -> None:
            found.clear()
            for side in sides:
                found.update({row[0]: int(row[1]) for row in connection.execute(side)})

        self._do("read", work)
        return dict(found)

    def matches_of(self, league: StoredLeague, labels: Collection[str], most: int) -> list[Outcome]:
        """Return the matches of these labels that were stored last, the last first."""
        sides = MATCHES.c.blue, MATCHES.c.red
        # A sum cannot be looked up: the database takes the index of the labels, not that of all matches from their end.
        ids = union_all(*(select(MATCHES.c.id).where(MATCHES.c.league_id == league.id, side.in_(labels)) for side in sides))
        last = ids.subquery()

        def work(connection: Connection) -> list[Row[Any]]:
            chosen = list(connection.scalars(select(last.c.id).order_by((last.c.id + 0).desc()).limit(most)))
            return list(connection.execute(select(MATCHES).where(MATCHES.c.id.in_(chosen))))

        rows = sorted(self._do("read", work), key=lambda row: -row.id)
        return [self._read(f"of the match {row.identity}", read_outcome, row) for row in rows]

    def put_standings(self, league: StoredLeague, document: Mapping[str, Any], now_s: float) -> None:
        """Keep the table as it stands; pages show it as it is."""
        values = {"made_at": now_s, "document": json.dumps(document)}
        row = self._insert(SEASON_STANDINGS).values(league_id=league.id, **values)
        change = row.on_conflict_do_update(index_elements=["league_id"], set_=values)
        self._do("write to", lambda connection: connection.execute(change), league.name)

    def standings(self, league: StoredLeague) -> Mapping[str, Any] | None:
        """Return the table as it stood last, and under `made_at` when that was; None before the first."""
        query = select(SEASON_STANDINGS).where(SEASON_STANDINGS.c.league_id == league.id)
        row = self._do("read", lambda connection: connection.execute(query).one_or_none())
        return None if row is None else {**json.loads(row.document), "made_at": row.made_at}

    def _play_version(self, connection: Connection, league_id: int, entry: str, owner: str, number: int) -> None:
        values = {"owner": owner, "number": number, "is_withdrawn": False}
        row = self._insert(SEASON_ENTRIES).values(league_id=league_id, entry=entry, **values)
        connection.execute(row.on_conflict_do_update(index_elements=["league_id", "entry"], set_=values))

    def _redefine(self, connection: Connection, league: StoredLeague) -> None:
        """Write the current versions into the season's definition."""
        current = (
            select(SEASON_ENTRIES.c.entry, SEASON_ENTRIES.c.number, VERSIONS.c.fingerprint)
            .join(
                VERSIONS,
                (VERSIONS.c.league_id == SEASON_ENTRIES.c.league_id)
                & (VERSIONS.c.entry == SEASON_ENTRIES.c.entry)
                & (VERSIONS.c.number == SEASON_ENTRIES.c.number),
            )
            .where(SEASON_ENTRIES.c.league_id == league.id, SEASON_ENTRIES.c.is_withdrawn.is_(False))
        )
        entries = {label_of(row.entry, row.number): row.fingerprint for row in connection.execute(current)}
        facts = json.loads(connection.scalar(select(LEAGUES.c.facts).where(LEAGUES.c.id == league.id)) or "{}")
        facts["entries"] = dict(sorted(entries.items()))
        values = {"facts": json.dumps(facts, sort_keys=True), "hash": hash_definition(facts)}
        connection.execute(update(LEAGUES).where(LEAGUES.c.id == league.id).values(values))


def _submission(row: Row[Any]) -> Submission:
    values = {**row._mapping, "report": None if row.report is None else json.loads(row.report)}
    del values["league_id"]
    return Submission(**values)
