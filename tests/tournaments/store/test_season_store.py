"""Seasons in the store: what is submitted becomes a version, and nothing of it is lost or mixed up."""

from collections.abc import Iterator

import pytest
from outcomes import ended

from arena.game.types import Team
from tournaments.store.season_store import ACCEPTED, REFUSED, WAITING, SeasonStore, Submission, WithdrawnError
from tournaments.store.store import StoredLeague, StoreError

DEFINITION = {"ruleset": "paper", "rules": "1", "entries": {"rush": "rush"}, "clock": {}, "season": True, "secret": "s"}


@pytest.fixture
def store(store_url: str) -> Iterator[SeasonStore]:
    with SeasonStore(store_url) as store:
        yield store


@pytest.fixture
def season(store: SeasonStore) -> StoredLeague:
    return store.open_season("course", DEFINITION, 1.0)


def submit(store: SeasonStore, season: StoredLeague, digest: str, entry: str = "ann") -> Submission:
    return store.submit(season, entry=entry, owner=f"{entry}s key", digest=digest, n_bytes=7, now_s=2.0)


def accept(store: SeasonStore, season: StoredLeague, digest: str, entry: str = "ann") -> str:
    given = submit(store, season, digest, entry)
    return store.accept(season, given, spec=f"{digest}/bot.py", says="it plays", report={"a": 1}, now_s=3.0).label


def current(store: SeasonStore) -> list[str]:
    return list(store.get("course").definition["entries"])


def test_a_season_begins_with_the_entries_of_its_file(store: SeasonStore, season: StoredLeague) -> None:
    assert current(store) == ["rush"]
    store.open_season("course", {**DEFINITION, "entries": {"patrol": "patrol"}}, 2.0)
    assert current(store) == ["patrol"]
    with pytest.raises(StoreError, match="rules were edited"):
        store.open_season("course", {**DEFINITION, "rules": "2"}, 3.0)


def test_a_submission_waits_and_becomes_a_version_or_is_refused(store: SeasonStore, season: StoredLeague) -> None:
    one, other = submit(store, season, "d1"), submit(store, season, "d2")
    assert [given.state for given in store.submissions(season, state=WAITING)] == [WAITING, WAITING]

    store.refuse(season, one, "it dies in tick 3")
    version = store.accept(season, other, spec="d2/bot.py", says="it plays", report={"p99": 2}, now_s=4.0)

    assert version.label == "ann"
    refused, accepted = store.submissions(season, entry="ann")
    assert (refused.state, refused.says, refused.number) == (REFUSED, "it dies in tick 3", None)
    assert (accepted.state, accepted.report, accepted.number) == (ACCEPTED, {"p99": 2}, 1)
    assert current(store) == ["ann", "rush"]
    with pytest.raises(WithdrawnError, match="ann was withdrawn"):
        store.accept(season, one, spec="d1/bot.py", says="it plays", report=None, now_s=5.0)
    store.refuse(season, other, "it was withdrawn")
    assert [given.state for given in store.submissions(season)] == [REFUSED, ACCEPTED]
    assert current(store) == ["ann", "rush"]


def test_versions_are_numbered_and_code_that_was_played_before_is_the_version_that_it_was(
    store: SeasonStore, season: StoredLeague
) -> None:
    assert [accept(store, season, digest) for digest in ("d1", "d2", "d1", "d3")] == ["ann", "ann.2", "ann", "ann.3"]
    assert current(store) == ["ann.3", "rush"]
    assert [one.spec for one in store.versions(season) if one.entry == "ann"] == ["d1/bot.py", "d2/bot.py", "d3/bot.py"]


def test_an_entry_goes_back_and_is_withdrawn_and_its_results_stay(store: SeasonStore, season: StoredLeague) -> None:
    for digest in ("d1", "d2"):
        accept(store, season, digest)
    store.add(season, ended("course/ann.2/rush/0000/rush-blue/0", "rush", "ann.2", Team.RED))
    entry = store.find_entry(season, "ann")
    assert entry is not None

    store.play_version(season, entry, 1)
    assert current(store) == ["ann", "rush"]
    store.withdraw(season, entry)
    assert current(store) == ["rush"]

    assert store.count_results(season) == {("rush", "ann.2"): (0, 0, 1)}
    assert [one.red for one in store.matches_of(season, ["ann", "ann.2"], 5)] == ["ann.2"]


def test_submissions_that_came_before_the_first_match_outlive_a_restart(store: SeasonStore, season: StoredLeague) -> None:
    accept(store, season, "d1")
    other = store.open_season("another", {**DEFINITION, "entries": {"patrol": "patrol"}}, 8.0)
    accept(store, other, "d1", "bob")
    again = store.open_season("course", DEFINITION, 9.0)

    assert list(again.definition["entries"]) == ["ann", "rush"]
    assert list(store.get("another").definition["entries"]) == ["bob", "patrol"]
    assert again.id == season.id


def test_the_file_of_a_season_takes_no_authors_name(store: SeasonStore, season: StoredLeague) -> None:
    accept(store, season, "d1")

    with pytest.raises(StoreError, match="has an entry ann of an author"):
        store.open_season("course", {**DEFINITION, "entries": {"ann": "rush"}}, 2.0)


def test_the_table_is_kept_as_it_stands(store: SeasonStore, season: StoredLeague) -> None:
    assert store.standings(season) is None
    for made_at in (5.0, 6.0):
        store.put_standings(season, {"rows": [made_at]}, made_at)

    assert store.standings(season) == {"rows": [6.0], "made_at": 6.0}
    accept(store, season, "d1")
    accept(store, season, "d2")
    store.keep_rating(season, "ann", 1, {"elo": 3.5})
    assert [one.rating for one in store.versions(season)] == [{"elo": 3.5}, None, None]
