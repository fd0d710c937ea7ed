"""Results in SQL, each match once: what is in here is never played again.

Tables: `leagues`, a row with the definition of each; `versions`, of its entries; `matches`, a row for each match that ended, its
identity unique. SQLite in WAL mode, so that reports can be read while a league runs; or PostgreSQL, which may be killed and come
back while a league runs. A commit reaches the system at once: a killed process loses nothing.
"""

import json
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

from sqlalchemy import ColumnElement, Connection, delete, func, select, update

from arena.errors import UnknownNameError
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from tournaments.league.edits import find_edit, hash_definition
from tournaments.league.versions import Version, entry_of, match_versions, with_labels
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.store.database import Database
from tournaments.store.lock import TakenError
from tournaments.store.schema import LEAGUES, MATCHES, VERSIONS, StoreError

__all__ = ["Store", "StoreError", "StoredLeague", "TakenError"]

_STORED_NAMES = {"challenger": "hero"}
"""Keys of a definition that rows hold under another name: a league's hash, too, is of these."""
_REVEALED = "revealed"
"""Where the row of a closed league holds its secret, beside its definition."""
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredLeague:
    """A league as its results were played under."""

    id: int
    name: str
    hash: str
    definition: Mapping[str, Any]
    """`League.definition`, its entries by the labels of their current versions; under `secret`, what binds it to its secret."""
    n_pairs: int
    secret: bytes | None = None
    """None until the league is closed for good: who knows it knows the maps of matches that could still be added."""

    @property
    def is_season(self) -> bool:
        """Whether its entries are submitted, and its pairs chosen as it goes on."""
        return "season" in self.definition

    @property
    def labels(self) -> dict[str, str]:
        """What the current version of each entry plays under, by entry."""
        return {entry_of(label): label for label in self.definition["entries"]}

    def current(self, outcomes: Iterable[Outcome]) -> list[Outcome]:
        """Return the results of those that are between current versions."""
        entries = self.definition["entries"]
        return [outcome for outcome in outcomes if outcome.blue in entries and outcome.red in entries]


class Store(Database):
    """The results of all leagues in one database."""

    @cached_property
    def _keep(self) -> Any:
        keep = self._insert(MATCHES).on_conflict_do_nothing(index_elements=["identity"]).inline()
        return keep.execution_options(preserve_rowcount=True)

    def enter(self, name: str, definition: Mapping[str, Any], n_pairs: int) -> StoredLeague:
        """Return the row of a league that is about to be run, made if need be; whatever code is new in it is a new version.

        Parameters
        ----------
        definition
            Of the league's file: its entries by their names.

        Raises
        ------
        StoreError
            It has results that were played under other rules, a secret or a clock of its own, or more pairs; the sentence names
            the edit. Or it is closed, and was given more to play.
        """
        before = self.find(name)
        if before is not None and not before.is_season and self.count(before) == 0:
            before = None  # nothing was played: it may still become another league
        known = [] if before is None else self.versions(before)
        versions = match_versions(definition["entries"], known)
        if before is not None:
            check_edit(before, definition, n_pairs, has_new={one.label for one in versions} - {one.label for one in known})
        stored = _rename(with_labels(definition, {one.entry: one.label for one in versions}), _STORED_NAMES)
        facts, now_s = _pack_facts(stored, None if before is None else before.secret), time.time()
        values = {"hash": hash_definition(stored), "facts": facts, "n_pairs": n_pairs, "run_at": now_s}
        row = self._insert(LEAGUES).values(name=name, **values).on_conflict_do_update(index_elements=["name"], set_=values)

        def work(connection: Connection) -> None:
            connection.execute(row)
            league_id = connection.scalar(select(LEAGUES.c.id).where(LEAGUES.c.name == name))
            if before is None:
                connection.execute(delete(VERSIONS).where(VERSIONS.c.league_id == league_id))
            for version in versions:
                if version not in known:
                    connection.execute(self._keep_version(int(league_id or 0), version, now_s))

        self._do("write to", work, name)
        found = self.find(name)
        if found is None:
            raise StoreError(f"league {name} was taken out of the store while it began")
        return found

    def _keep_version(self, league_id: int, version: Version, now_s: float) -> Any:
        values = {"league_id": league_id, "entry": version.entry, "number": version.number, "fingerprint": version.fingerprint}
        row = self._insert(VERSIONS).values(**values, entered_at=now_s, spec=version.spec)
        return row.on_conflict_do_update(
            index_elements=["league_id", "entry", "number"], set_={"fingerprint": version.fingerprint}
        )

    def versions(self, league: StoredLeague, entry: str | None = None) -> list[Version]:
        """Return every version that a league had, of all entries or of one, in the order of entries and numbers."""
        query = select(VERSIONS).where(VERSIONS.c.league_id == league.id).order_by(VERSIONS.c.number)
        if entry is not None:
            query = query.where(VERSIONS.c.entry == entry)
        rows = self._do("read", lambda connection: connection.execute(query).all())
        versions = (self._read(f"of a version of {row.entry}", _version, row) for row in rows)
        return sorted(versions, key=lambda one: (one.entry, one.number))  # databases sort by their locale

    def close(self, league: StoredLeague, secret: bytes) -> StoredLeague:
        """Close a league whose lock is held, for good: its secret may be known from now on, and no pairs are added to it."""
        current = self.get(league.name)
        facts = _pack_facts(_rename(current.definition, _STORED_NAMES), secret)
        row = update(LEAGUES).where(LEAGUES.c.id == league.id).values(facts=facts)
        self._do("write to", lambda connection: connection.execute(row), league.name)
        return replace(current, secret=secret)

    def find(self, name: str) -> StoredLeague | None:
        """Return a league by its name."""
        rows = self._leagues(select(LEAGUES).where(LEAGUES.c.name == name))
        return rows[0] if rows else None

    def get(self, name: str) -> StoredLeague:
        """Return a league by its name, or refuse, naming the nearest."""
        found = self.find(name)
        if found is None:
            self.latest()
            raise UnknownNameError(f"league in {self._where}", name, [league.name for league in self.leagues()])
        return found

    def latest(self) -> StoredLeague:
        """Return the league that was run last."""
        leagues = self.leagues()
        if not leagues:
            raise StoreError(f"the store {self._where} holds no league yet; arena tournament run plays one")
        return leagues[0]

    def leagues(self) -> list[StoredLeague]:
        """Return every league, the one that was run last first."""
        return self._leagues(select(LEAGUES).order_by(LEAGUES.c.run_at.desc(), LEAGUES.c.id.desc()))

    def _leagues(self, query: Any) -> list[StoredLeague]:
        rows = self._do("read", lambda connection: connection.execute(query).all())
        return [self._read(f"of the league {row.name}", _league, row) for row in rows]

    def _read(self, what: str, read: Callable[[Any], T], row: Any) -> T:
        """Return what a row holds; `StoreError` if somebody else than a store wrote it."""
        try:
            return read(row)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            way_out = "restore the store from a copy, or take the row out"
            raise StoreError(f"the row {what} in the store {self._where} cannot be read ({error!r}): {way_out}") from error

    def add(self, league: StoredLeague, outcome: Outcome) -> bool:
        """Keep a match that ended; False if it was kept before. A void match is no result and is refused."""
        result = outcome.result
        if result.ending in (Termination.VOID, Termination.RUNNING):
            raise ValueError(f"{outcome.identity} is {result.ending.name.lower()}, which is no result")
        row = {
            "league_id": league.id,
            "identity": outcome.identity,
            "blue": outcome.blue,
            "red": outcome.red,
            **result.to_dict(),
            "reason": _clean(result.reason),
            "seats": json.dumps({team.name.lower(): _pack(seat) for team, seat in sorted(outcome.seats.items())}),
        }
        n_tries = 0

        def work(connection: Connection) -> bool:
            nonlocal n_tries
            n_tries += 1
            if connection.execute(self._keep, row).rowcount == 1:
                return True
            if n_tries == 1:
                return False
            # A server that died before it answered may have kept it at an earlier try.
            kept = select(*(MATCHES.c[name] for name in row)).where(MATCHES.c.identity == outcome.identity)
            return dict(connection.execute(kept).one()._mapping) == row

        return self._do("write to", work, league.name)

    def outcomes(self, league: StoredLeague) -> list[Outcome]:
        """Return a league's results, sorted by identity: in whatever order they came, they are returned alike."""
        query = select(MATCHES).where(MATCHES.c.league_id == league.id)
        rows = self._do("read", lambda connection: connection.execute(query).all())
        return sorted(
            (self._read(f"of the match {row.identity}", read_outcome, row) for row in rows), key=lambda outcome: outcome.identity
        )  # databases sort by their locale

    def identities(self, league: StoredLeague) -> set[str]:
        """Return what was played."""
        query = select(MATCHES.c.identity).where(MATCHES.c.league_id == league.id)
        return self._do("read", lambda connection: set(connection.scalars(query)))

    def count(self, league: StoredLeague) -> int:
        """Return how many results a league has, those of earlier versions too."""
        return self._count(MATCHES.c.league_id == league.id)

    def count_current(self, league: StoredLeague) -> int:
        """Return how many results a league has between the current versions of its entries."""
        labels = list(league.definition["entries"])
        return self._count(MATCHES.c.league_id == league.id, MATCHES.c.blue.in_(labels), MATCHES.c.red.in_(labels))

    def _count(self, *where: ColumnElement[bool]) -> int:
        query = select(func.count()).select_from(MATCHES).where(*where)
        return self._do("read", lambda connection: int(connection.scalar(query) or 0))


def check_edit(before: StoredLeague, definition: Mapping[str, Any], n_pairs: int, *, has_new: Collection[str]) -> None:
    """Refuse what would make another league of one that has results; `has_new` are the labels that it has not had so far."""
    edit = find_edit(before.definition, definition)
    if edit is None and n_pairs < before.n_pairs:
        edit = f"pairs were lowered (were {before.n_pairs}, are {n_pairs})"
    if edit is not None:
        raise StoreError(f"league {before.name} has results, and {edit}: undo that, or give the league another name")
    if before.secret is not None and (has_new or n_pairs > before.n_pairs):
        more = ", ".join(sorted(has_new)) or "pairs"
        raise StoreError(
            f"league {before.name} is closed and takes no more matches ({more} would be new): whoever knows its secret knows the "
            "maps; give the league another name"
        )


def _rename(definition: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    return {names.get(key, key): value for key, value in definition.items()}


def _clean(words: str) -> str:
    """Replace what a text in PostgreSQL cannot hold, and what is no text: a reason may quote a stranger."""
    return words.replace("\0", "\N{REPLACEMENT CHARACTER}").encode("utf-8", "replace").decode()


def _league(row: Any) -> StoredLeague:
    definition = _rename(json.loads(row.facts), {old: name for name, old in _STORED_NAMES.items()})
    revealed = definition.pop(_REVEALED, None)
    secret = None if revealed is None else bytes.fromhex(revealed)
    return StoredLeague(id=row.id, name=row.name, hash=row.hash, definition=definition, n_pairs=row.n_pairs, secret=secret)


def _version(row: Any) -> Version:
    rating = None if row.rating is None else json.loads(row.rating)
    return Version(
        entry=row.entry, number=row.number, fingerprint=row.fingerprint, entered_at=row.entered_at, spec=row.spec, rating=rating
    )


def _pack_facts(stored: Mapping[str, Any], secret: bytes | None) -> str:
    return json.dumps({**stored, **({} if secret is None else {_REVEALED: secret.hex()})}, sort_keys=True)


def _pack(seat: SeatOutcome) -> dict[str, Any]:
    return {"faults": seat.faults, "latency_p50_s": seat.latency_p50_s, "latency_p99_s": seat.latency_p99_s}


def read_outcome(row: Any) -> Outcome:
    return Outcome(
        identity=row.identity,
        blue=row.blue,
        red=row.red,
        result=MatchResult.from_dict(row._mapping),
        seats={Team[name.upper()]: SeatOutcome(**seat) for name, seat in json.loads(row.seats).items()},
    )
