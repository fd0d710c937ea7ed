"""The seasons of a store as the web page gets them: a table that was kept, one entry's rows, and no owner's view for others."""

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from made_seasons import DEFINITION, keep_table, make_season, play_pairs, submit
from outcomes import met

from arena.errors import ArenaError, InputError, UnknownNameError
from arena.game.types import Team
from arena.protocol.identity import Identity
from arena.protocol.page_token import TOKEN_S, make_page_token
from arena.records.journal import journal_name
from tournaments.ratings.standings import Record
from tournaments.reports.web_leagues import Leagues
from tournaments.reports.web_seasons import MOST_MATCHES, NOT_THE_OWNER, Seasons
from tournaments.store.entry_history import EntryHistory
from tournaments.store.season_store import SeasonStore

NOW_S, HOST = 1_000_000.0, "arena.example"
ANN, BOB = Identity.make(), Identity.make()
OWNERS = {"ann": ANN.fingerprint, "bob": BOB.fingerprint, "cid": "cid's key"}
PAGE_S = 0.2
logger = logging.getLogger(__name__)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a data folder with a season of three entries with two versions each, and 60 pairs."""
    with SeasonStore(str(tmp_path / "arena.db")) as store:
        league = make_season(store, OWNERS, 2)
        play_pairs(store, league, ["ann", "bob", "cid"], 10)
        play_pairs(store, league, ["ann.2", "bob.2", "cid.2"], 50, seed=2)
        keep_table(store, league)
    return tmp_path


@pytest.fixture
def seasons(data: Path) -> Seasons:
    return Seasons(data, "", clock=lambda: NOW_S)


def change(data: Path, do: Callable[[SeasonStore, Any], object]) -> None:
    with SeasonStore(str(data / "arena.db")) as store:
        do(store, store.get("course"))


def test_where_there_is_no_store_there_are_no_seasons(tmp_path: Path) -> None:
    assert Seasons(tmp_path, "").names() == []


def test_a_season_is_listed_as_one_and_not_as_a_league(data: Path, seasons: Seasons) -> None:
    leagues = Leagues(data, "")

    assert (seasons.names(), leagues.names()) == (["course"], [])
    with pytest.raises(InputError, match="course is a season: its page is /seasons/course"):
        leagues.report("course")
    with pytest.raises(InputError, match="its page is"):
        leagues.head_to_head("course", "ann", "bob")
    with pytest.raises(UnknownNameError, match="unknown season 'cours'; did you mean 'course'"):
        seasons.season("cours")


def test_a_season_shows_the_table_that_was_kept(data: Path, seasons: Seasons) -> None:
    change(data, lambda store, league: keep_table(store, league, phase="frozen", n_waiting=3, new={"bob.2"}))

    shown = seasons.season("course")

    assert (shown["phase"], shown["matches"], shown["waiting"], shown["playing"]) == ("frozen", 120, 3, 2)
    rows = shown["leaderboard"]["rows"]
    assert [[cell["text"] for cell in row[:3]] for row in rows] == [["1", "ann", 2], ["2", "bob", 2], ["3", "cid", 2]]
    assert [row[1].get("tag") for row in rows] == [None, "new", None]


def test_a_season_names_its_final_once_that_has_begun(data: Path, seasons: Seasons) -> None:
    change(data, lambda store, _: store.enter("course-final", {**DEFINITION, "entries": {"ann": "a"}}, 1))
    assert "final" not in seasons.season("course")
    change(data, lambda store, league: keep_table(store, league, phase="final"))
    assert seasons.season("course")["final"] == "course-final"


def test_a_season_that_has_not_begun_has_no_table(tmp_path: Path) -> None:
    with SeasonStore(str(tmp_path / "arena.db")) as store:
        make_season(store, {"ann": "a"})

    assert Seasons(tmp_path, "").season("course") == {"season": "course", "leaderboard": None}
    assert Seasons(tmp_path, "").entry("course", "ann")["versions"][0]["rating"] is None


def test_an_entry_shows_its_versions_its_last_matches_and_its_opponents(data: Path, seasons: Seasons) -> None:
    def add(store: SeasonStore, league: Any) -> None:
        for pair, winner in ((7, Team.BLUE), (8, Team.RED)):
            store.add(league, met("ann", "bob", pair, "bob", winner, league="course"))

    change(data, add)
    shown = seasons.entry("course", "ann")

    assert shown["plays"] == 2
    ratings = [(one["number"], one["rating"]["elo"], one["rating"]["matches"]) for one in shown["versions"]]
    assert ratings == [(1, 10.0, 40), (2, 99.0, 8)]
    last = [one["identity"] for one in shown["matches"]]
    assert last[:2] == ["course/ann/bob/0008/bob-blue/0", "course/ann/bob/0007/bob-blue/0"], "an old version may play again"
    assert len(last) == MOST_MATCHES
    assert [one["is_visible"] for one in shown["matches"]] == [False, False] + [True] * (MOST_MATCHES - 2)
    with EntryHistory(str(data / "arena.db"), make=False) as store:
        outcomes = store.outcomes(store.get("course"))
    told = {one["opponent"]: one for one in (*shown["best"], *shown["worst"])}
    for other in ("bob.2", "cid.2"):
        record = Record()
        for one in outcomes:
            if {one.blue, one.red} == {"ann.2", other}:
                record.add(one.points("ann.2"))
        assert Record(**{key: told[other][key] for key in ("wins", "draws", "losses")}) == record
    assert told.keys() == {"bob.2", "cid.2"}
    with pytest.raises(UnknownNameError, match="unknown entry of season course 'anne'; did you mean 'ann'"):
        seasons.entry("course", "anne")


def test_an_opponent_that_was_met_often_is_better_known_than_one_met_once(tmp_path: Path, seasons: Seasons, data: Path) -> None:
    with SeasonStore(str(data / "arena.db")) as store:
        league = make_season(store, {"eve": "e", "often": "o", "once": "n", "rival": "r"}, name="other")
        for other, n_pairs, loser in (("often", 20, "often"), ("once", 1, "once"), ("rival", 20, "eve")):
            for pair in range(n_pairs):
                for blue in ("eve", other):
                    store.add(league, met("eve", other, pair, blue, Team.RED if blue == loser else Team.BLUE, league="other"))

    shown = seasons.entry("other", "eve")

    assert [one["opponent"] for one in shown["best"]] == ["often", "once"]
    assert [one["opponent"] for one in shown["worst"]] == ["rival"]


def test_a_frozen_table_is_not_told_by_the_pages_of_its_entries(data: Path, seasons: Seasons) -> None:
    def freeze(store: SeasonStore, league: Any) -> None:
        keep_table(store, league, phase="frozen")
        given = store.submit(league, entry="ann", owner=ANN.fingerprint, digest="new", n_bytes=1, now_s=8.0)
        store.keep_rating(league, "ann", 2, {"elo": 999.0, "elo_low": 900.0, "elo_high": 1100.0, "matches": 9})
        store.accept(league, given, spec="x", says="", report=None, now_s=9.0)
        store.keep_rating(league, "ann", 3, {"elo": 777.0, "elo_low": 700.0, "elo_high": 800.0, "matches": 9})
        store.keep_rating(league, "ann", 1, {"elo": 777.0, "elo_low": 700.0, "elo_high": 800.0, "matches": 9})
        store.play_version(league, store.entries(league)[0], 2)

    identity = seasons.entry("course", "ann")["matches"][0]["identity"]
    change(data, freeze)

    shown = seasons.entry("course", "ann")

    assert not shown.keys() & {"matches", "best", "worst"}
    assert [one["rating"] and one["rating"]["elo"] for one in shown["versions"]] == [None, 99.0, None]
    with pytest.raises(ArenaError, match="frozen"):
        Leagues(data, "").journal("course", identity)
    assert len(seasons.own("course", "ann", make_page_token(ANN, HOST, "course", NOW_S), HOST)["matches"]) == MOST_MATCHES


def test_a_journal_may_be_seen_once_its_own_pair_is_over(data: Path) -> None:
    matches = [met("ann", "bob", 7, blue, Team.BLUE, league="course") for blue in ("ann", "bob")]
    folder = data / "journals" / "course"
    folder.mkdir(parents=True)
    (folder / journal_name(matches[0].identity)).write_bytes(b"a journal")
    leagues = Leagues(data, "")

    with pytest.raises(ArenaError, match="has no match"):
        leagues.journal("course", matches[0].identity)
    change(data, lambda store, league: store.add(league, matches[0]))
    with pytest.raises(ArenaError, match="until both matches of its pair are over"):
        leagues.journal("course", matches[0].identity)
    change(data, lambda store, league: store.add(league, matches[1]))
    assert leagues.journal("course", matches[0].identity) == b"a journal"
    for identity in ("", "course/ann", "course/../../keys", "other/ann/bob/0007/ann-blue/0"):
        with pytest.raises(ArenaError, match="has no match"):
            leagues.journal("course", identity)


def test_the_owner_sees_the_queue_what_checks_found_and_the_log(data: Path, seasons: Seasons) -> None:
    def submit_some(store: SeasonStore, league: Any) -> None:
        submit(store, league, "bob", BOB.fingerprint)
        submit(store, league, "ann", ANN.fingerprint, "it dies in tick 3")
        submit(store, league, "ann", ANN.fingerprint)

    change(data, submit_some)
    log = data / "journals" / "course" / "ann.2.log"
    log.parent.mkdir(parents=True)
    log.write_text("x" * 30_000 + "the end")

    own = seasons.own("course", "ann", make_page_token(ANN, HOST, "course", NOW_S), HOST)

    assert own["queue"] == 2
    waiting, refused = own["submissions"]
    assert (waiting["state"], waiting["lines"]) == ("waiting", [])
    assert (refused["state"], refused["says"]) == ("refused", "it dies in tick 3")
    assert refused["lines"] == ["ann: 700 bytes", "it dies in tick 3"]
    assert own["log"].endswith("xthe end")
    assert len(own["log"]) == 20_000


def test_the_owner_of_what_only_waits_sees_it_before_there_is_an_entry(data: Path, seasons: Seasons) -> None:
    dora = Identity.make()
    change(data, lambda store, league: submit(store, league, "dora", dora.fingerprint))

    assert seasons.own("course", "dora", make_page_token(dora, HOST, "course", NOW_S), HOST)["queue"] == 1
    with pytest.raises(UnknownNameError):
        seasons.entry("course", "dora")


def test_whoever_is_not_the_owner_gets_one_answer_whatever_is_wrong(data: Path, seasons: Seasons) -> None:
    change(data, lambda store, league: submit(store, league, "new", BOB.fingerprint, "a secret of bob's"))
    good = make_page_token(ANN, HOST, "course", NOW_S)
    tokens = {
        "none": ("ann", ""),
        "junk": ("ann", "\0" * 139),
        "another's": ("ann", make_page_token(BOB, HOST, "course", NOW_S)),
        "expired": ("ann", make_page_token(ANN, HOST, "course", NOW_S - TOKEN_S)),
        "another season's": ("ann", make_page_token(ANN, HOST, "other", NOW_S)),
        "another page's": ("ann", make_page_token(ANN, "evil.example", "course", NOW_S)),
        "cut": ("ann", good[:-1]),
        "another's entry": ("bob", good),
        "another's that only waits": ("new", good),
        "no entry": ("nobody", good),
        "the organiser's": ("rush", good),
    }
    change(data, lambda store, league: store._do("write to", lambda c: store._play_version(c, league.id, "rush", "", 1)))

    said = set()
    for entry, token in tokens.values():
        with pytest.raises(ArenaError) as refused:
            seasons.own("course", entry, token, HOST)
        said.add((type(refused.value), str(refused.value)))
    with pytest.raises(ArenaError) as refused:
        seasons.own("nowhere", "ann", make_page_token(ANN, HOST, "nowhere", NOW_S), HOST)
    said.add((type(refused.value), str(refused.value)))

    assert said == {(ArenaError, NOT_THE_OWNER)}
    assert seasons.own("course", "ann", good, HOST)


def test_an_owner_whose_name_was_taken_by_another_sees_nothing_of_the_entry(data: Path, seasons: Seasons) -> None:
    change(data, lambda store, league: submit(store, league, "ann", BOB.fingerprint))

    with pytest.raises(ArenaError, match="only the owner"):
        seasons.own("course", "ann", make_page_token(BOB, HOST, "course", NOW_S), HOST)
    own = seasons.own("course", "ann", make_page_token(ANN, HOST, "course", NOW_S), HOST)
    assert own["submissions"] == []


def test_pages_read_no_more_of_the_store_when_others_play_more(tmp_path: Path, size: Callable[[int, int], int]) -> None:
    """At its full size, this is the season of which the pages must answer in 200 ms."""
    n_others, n_versions, n_pairs = size(20, 198), size(4, 20), size(1_500, 150_000)
    others = {f"other{number:03}": f"{number}" for number in range(n_others)}
    with SeasonStore(str(tmp_path / "arena.db")) as store:
        league = make_season(store, {"ann": ANN.fingerprint, "idle": "i", **others}, n_versions)
        labels = [f"{name}.{n_versions}" for name in ("ann", "idle", *others)]
        play_pairs(store, league, labels, n_pairs // 10)
        keep_table(store, league)
        n_before = {name: count_steps(tmp_path, ask) for name, ask in PAGES.items()}
        play_pairs(store, league, labels[2:], n_pairs, seed=2)
        n_after = {name: count_steps(tmp_path, ask) for name, ask in PAGES.items()}
        assert store.count(league) == 2 * (n_pairs + n_pairs // 10)

    assert all(n_after[name] <= 1.2 * n_before[name] + 10 for name in PAGES), (n_before, n_after)
    if n_pairs == 150_000:
        for name, ask in PAGES.items():
            times_s = []
            for _ in range(9):
                begun = time.perf_counter()
                ask(Seasons(tmp_path, "", clock=lambda: NOW_S))
                times_s.append(time.perf_counter() - begun)
            logger.info("%s: %.0f ms, at worst %.0f ms", name, 1_000 * sorted(times_s)[4], 1_000 * max(times_s))
            assert sorted(times_s)[4] < PAGE_S


PAGES: dict[str, Callable[[Seasons], object]] = {
    "the names": lambda seasons: seasons.names(),
    "the season": lambda seasons: seasons.season("course"),
    "an entry": lambda seasons: seasons.entry("course", "ann"),
    "an idle entry": lambda seasons: seasons.entry("course", "idle"),
    "the owner's view": lambda seasons: seasons.own("course", "ann", make_page_token(ANN, HOST, "course", NOW_S), HOST),
}


def count_steps(data: Path, ask: Callable[[Seasons], object]) -> int:
    """Return how many hundreds of instructions SQLite carries out to answer: no clock, and no other process, changes that."""
    n_steps = 0

    def count() -> int:
        nonlocal n_steps
        n_steps += 1
        return 0

    seasons = Seasons(data, "", clock=lambda: NOW_S)
    with seasons._open() as store:
        with store._engine.connect() as connection:  # the one that its pool will lend again
            sqlite: Any = connection.connection.dbapi_connection
            sqlite.set_progress_handler(count, 100)
        seasons._open = lambda: store  # type: ignore[method-assign]  # the store whose steps are counted
        ask(seasons)
    return n_steps
