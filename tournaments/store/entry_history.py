"""What one entry of a season did, for its page: each question reads that entry's rows alone, however many others there are."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from functools import partial
from typing import Any

from sqlalchemy import Connection, Row, Select, func, select, union_all

from arena.game.types import Team
from tournaments.league.versions import Version
from tournaments.outcome import Outcome
from tournaments.ratings.standings import Record
from tournaments.store.schema import MATCHES, SUBMISSIONS, VERSIONS
from tournaments.store.season_store import WAITING, SeasonStore, Submission
from tournaments.store.store import StoredLeague, read_outcome, read_version


class EntryHistory(SeasonStore):
    """A store of seasons, asked about one entry."""

    def versions_of(self, league: StoredLeague, entry: str) -> list[Version]:
        """Return the versions of an entry in the order of their numbers."""
        query = select(VERSIONS).where(VERSIONS.c.league_id == league.id, VERSIONS.c.entry == entry).order_by(VERSIONS.c.number)
        rows = self._do("read", partial(_all, query))
        return [self._read(f"of a version of {entry}", read_version, row) for row in rows]

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

    def records_against(self, league: StoredLeague, label: str) -> dict[str, Record]:
        """Return how a label fared against each other label that it met."""
        records: defaultdict[str, Record] = defaultdict(Record)
        for team, own, other in ((Team.BLUE, MATCHES.c.blue, MATCHES.c.red), (Team.RED, MATCHES.c.red, MATCHES.c.blue)):
            # They are counted here: a database that groups them may read the index of all opponents of all.
            query = select(other, MATCHES.c.winner).where(MATCHES.c.league_id == league.id, own == label)
            rows = self._do("read", partial(_all, query))
            for (opponent, winner), n in Counter(map(tuple, rows)).items():
                record = records[opponent]
                record.draws += n if winner is None else 0
                record.wins += n if winner == team.name.lower() else 0
                record.losses += n if winner not in (None, team.name.lower()) else 0
        return dict(records)

    def find_played(self, identities: Iterable[str]) -> set[str]:
        """Return those of some matches that are over."""
        query = select(MATCHES.c.identity).where(MATCHES.c.identity.in_(list(identities)))
        return self._do("read", lambda connection: set(connection.scalars(query)))

    def queue_position(self, league: StoredLeague, waiting: Submission) -> int:
        """Return how manieth a submission is to be checked, from 1."""
        before = (SUBMISSIONS.c.league_id == league.id) & (SUBMISSIONS.c.state == WAITING) & (SUBMISSIONS.c.id < waiting.id)
        query = select(func.count()).select_from(SUBMISSIONS).where(before)
        return 1 + self._do("read", lambda connection: int(connection.scalar(query) or 0))


def _all(query: Select[Any], connection: Connection) -> Sequence[Row[Any]]:
    return connection.execute(query).all()
