"""What one entry of a season did, for its page: each question reads that entry's rows alone, however many others there are."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

from sqlalchemy import Connection, Row, Select, select

from arena.game.types import Team
from tournaments.ratings.standings import Record
from tournaments.store.schema import MATCHES
from tournaments.store.season_store import SeasonStore
from tournaments.store.store import StoredLeague


class EntryHistory(SeasonStore):
    """A store of seasons, asked about one entry."""

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


def _all(query: Select[Any], connection: Connection) -> Sequence[Row[Any]]:
    return connection.execute(query).all()
