"""The ladder over its store, on each database: what is counted, and what a pit that comes back finds."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from sqlalchemy import event

from arena.errors import ArenaError
from arena.game.types import Team, Termination
from arena.pit.ladder import LadderMatch, Waiting
from arena.policy import MatchResult
from arena.protocol.identity import to_text
from tournaments.ladder.ladder import RatedLadder, open_ladder
from tournaments.ladder.ladder_store import LadderStore, TakenLadderError
from tournaments.ladder.skill import LadderEntry, rate
from tournaments.reports.ladder_table import read_ladder, render_ladder
from tournaments.store.schema import StoreError

KEYS = {name: bytes([number]) * 32 for number, name in enumerate(("ann", "bob", "cid"))}
RULES = "5" * 64


def match(
    number: int, winner: Team | None = Team.BLUE, ending: Termination = Termination.CAPTURE, blue: str = "ann", red: str = "bob"
) -> Any:
    return LadderMatch(
        identity=f"pit/ladder/{number:06}/{blue}/{red}",
        names={Team.BLUE: blue, Team.RED: red},
        entries={Team.BLUE: KEYS[blue], Team.RED: KEYS[red]},
        rules_hash=RULES,
        result=MatchResult(ending=ending, winner=winner, score=0, ticks=9, reason=""),
    )


def wait(*names: str) -> list[Waiting]:
    return [Waiting(entry=KEYS[name], since_s=0.0) for name in names]


def record(ladder: RatedLadder) -> dict[str, tuple[int, int, int]]:
    return {row["name"]: (row["wins"], row["draws"], row["losses"]) for row in ladder.standings()}


@pytest.fixture
def ladder(tmp_path: Path) -> Iterator[RatedLadder]:
    with open_ladder(str(tmp_path / "arena.db"), "pit", RULES) as opened:
        yield opened


def test_a_pit_that_comes_back_goes_on_with_the_same_ratings(store_url: str) -> None:
    with open_ladder(store_url, "pit", RULES) as ladder:
        assert ladder.standings() == []
        for number, winner in enumerate((Team.BLUE, None, Team.RED, Team.BLUE)):
            ladder.count(match(number, winner))
        before = ladder.standings()

    with open_ladder(store_url, "pit", RULES) as ladder:
        assert ladder.standings() == before
        assert record(ladder) == {"ann": (2, 1, 1), "bob": (1, 1, 2)}
        ladder.count(match(4))
        assert record(ladder)["ann"] == (3, 1, 1)


def test_the_stored_ratings_are_those_of_the_stored_matches_in_their_order(store_url: str) -> None:
    matches = [match(number, (Team.BLUE, Team.RED, None)[number % 3]) for number in range(9)]
    times = [1e9 * (1 + number) for number in range(9)]
    with open_ladder(store_url, "pit", RULES, iter(times).__next__) as ladder:
        for one in matches:
            ladder.count(one)

    players = {team: LadderEntry(key=to_text(KEYS[name]), name=name) for team, name in ((Team.BLUE, "ann"), (Team.RED, "bob"))}
    for one, now_s in zip(matches, times, strict=True):
        players = rate(players, one.result, now_s)
    with LadderStore(store_url, make=False) as store:
        assert sorted(store.entries("pit"), key=lambda player: player.name) == list(players.values())


def test_a_match_is_counted_once_whoever_brings_it(store_url: str) -> None:
    winner = {Team.BLUE: LadderEntry(key="a", name="ann", mu=30.0), Team.RED: LadderEntry(key="b", name="bob", mu=20.0)}
    other = {team: LadderEntry(key=player.key, name=player.name, mu=1.0) for team, player in winner.items()}
    with LadderStore(store_url) as store:
        assert store.count_match("pit", match(1), winner)
        assert not store.count_match("pit", match(1, Team.RED), other)

        assert {player.name: player.mu for player in store.entries("pit")} == {"ann": 30.0, "bob": 20.0}
        assert store.counted("pit") == {match(1).identity}


def test_a_server_that_dies_between_a_match_and_its_ratings_keeps_both_or_neither(cluster: Any) -> None:
    before = {team: LadderEntry(key=name, name=name) for team, name in zip(Team, ("ann", "bob"), strict=True)}
    after, deaths = rate(before, match(0).result), []
    with LadderStore(cluster.make_database()) as store, store.keep("pit"):

        @event.listens_for(store._engine, "after_cursor_execute")
        def die(*arguments: Any) -> None:
            if "INSERT INTO ladder_matches" in arguments[2] and not deaths:
                deaths.append(1)
                cluster.kill()
                cluster.start()

        assert store.count_match("pit", match(0), after)
        assert deaths
        assert store.entries("pit") == list(after.values())


def test_a_void_match_is_kept_and_moves_nothing(ladder: RatedLadder, tmp_path: Path) -> None:
    ladder.count(match(0))
    before = ladder.standings()

    ladder.count(match(1, None, Termination.VOID))
    ladder.count(match(2, None, Termination.VOID, red="cid"))
    ladder.close()

    assert ladder.standings() == before
    assert len(ladder.identities()) == 3
    with LadderStore(str(tmp_path / "arena.db"), make=False) as store:
        assert {player.name for player in store.entries("pit")} == {"ann", "bob"}


def test_an_entry_is_its_key_and_shown_under_its_last_name(ladder: RatedLadder) -> None:
    KEYS["anna"] = KEYS["ann"]
    ladder.count(match(0))
    ladder.count(match(1, blue="anna"))

    assert record(ladder) == {"anna": (2, 0, 0), "bob": (0, 0, 2)}


def test_whoever_was_blue_less_often_is_blue(ladder: RatedLadder) -> None:
    ladder.count(match(0))

    blue, red = ladder.choose(wait("ann", "bob"), 60.0) or pytest.fail("nobody was chosen")

    assert (blue.entry, red.entry) == (KEYS["bob"], KEYS["ann"])


def test_those_who_met_last_do_not_meet_at_once_while_another_waits(ladder: RatedLadder) -> None:
    assert ladder.choose(wait("ann", "bob"), 0.0) is not None

    assert ladder.choose(wait("ann", "bob"), 0.0) is None
    chosen = ladder.choose(wait("ann", "bob", "cid"), 0.0)

    assert chosen is not None
    assert KEYS["cid"] in [one.entry for one in chosen]


def test_a_strong_entry_waits_longer_for_a_weak_one(ladder: RatedLadder) -> None:
    for number in range(30):
        ladder.count(match(number))

    assert ladder.choose(wait("ann", "bob"), 0.5) is None
    assert ladder.choose(wait("ann", "bob"), 60.0) is not None


def test_entries_of_an_older_store_played_last_when_their_last_match_was_counted(tmp_path: Path) -> None:
    file = tmp_path / "arena.db"
    with closing(sqlite3.connect(file)) as database:
        database.executescript((Path(__file__).parents[1] / "store" / "gauntlet_of_0002.sql").read_text())
        entries = [("pit", key, key, 25.0, 3.0, 1, 0, 1, 0, 1) for key in ("a", "b", "c")]
        database.executemany(f"INSERT INTO ladder_entries VALUES (NULL, {', '.join('?' * 10)})", entries)
        for number, (blue, red) in enumerate((("a", "b"), ("b", "a"), ("c", "a"))):
            row = ("pit", f"x{number}", blue, red, blue, red, "capture", "blue", 1, 9, "", RULES, 1e9 + number)
            database.execute(f"INSERT INTO ladder_matches VALUES (NULL, {', '.join('?' * 13)})", row)
        database.execute("UPDATE ladder_matches SET ladder = 'pond' WHERE identity = 'x2'")
        database.commit()

    with LadderStore(str(file)) as store:
        found = {entry.name: (entry.played_at, entry.version, entry.sigma) for entry in store.entries("pit")}

    assert found == {"a": (1e9 + 1, "", 3.0), "b": (1e9 + 1, "", 3.0), "c": (0.0, "", 3.0)}


def test_the_version_that_an_entry_came_with_is_kept_and_a_new_one_is_less_known(store_url: str) -> None:
    def play(ladder: RatedLadder, number: int, version: str) -> float:
        both = [replace(one, version=version if one.entry == KEYS["ann"] else "") for one in wait("ann", "bob")]
        assert ladder.choose(both, 60.0) is not None
        ladder.count(match(number))
        return float(next(row["sigma"] for row in ladder.standings() if row["name"] == "ann"))

    with open_ladder(store_url, "pit", RULES) as ladder:
        sigmas = [play(ladder, number, "one") for number in range(40)]
    with open_ladder(store_url, "pit", RULES) as ladder:
        same, new = play(ladder, 40, "one"), play(ladder, 41, "two")

    assert same <= sigmas[-1] < new
    with LadderStore(store_url, make=False) as store:
        assert {entry.name: entry.version for entry in store.entries("pit")} == {"ann": "two", "bob": ""}


def test_two_pits_of_one_name_do_not_share_a_ladder(store_url: str) -> None:
    with (
        open_ladder(store_url, "pit", RULES),
        pytest.raises(TakenLadderError, match="another pit of the name pit"),
        open_ladder(store_url, "pit", RULES),
    ):
        pytest.fail("it was opened twice")


def test_pits_of_other_names_have_ladders_of_their_own(store_url: str) -> None:
    with open_ladder(store_url, "pit", RULES) as one, open_ladder(store_url, "pond", RULES) as other:
        one.count(match(0))

        assert other.standings() == []


def test_other_rules_are_refused(store_url: str) -> None:
    with open_ladder(store_url, "pit", RULES) as ladder:
        ladder.count(match(0))

    with pytest.raises(StoreError, match=r"under other rules .5555.*these are 6666"), open_ladder(store_url, "pit", "6" * 64):
        pytest.fail("it was opened")
    with open_ladder(store_url, "pond", "6" * 64):
        pass


def test_a_store_that_fails_stops_the_pit_with_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> bool:
        raise StoreError("the disk is full")

    ladder = RatedLadder(LadderStore(str(tmp_path / "arena.db")), "pit")
    monkeypatch.setattr(LadderStore, "count_match", fail)
    ladder.count(match(0))

    with pytest.raises(ArenaError, match="the disk is full"):
        ladder.close()
    with pytest.raises(ArenaError, match="the disk is full"):
        ladder.count(match(1))


def test_a_ladder_tells_how_far_its_store_is_behind(ladder: RatedLadder, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, may_end, count = Event(), Event(), LadderStore.count_match

    def count_slowly(*row: Any) -> bool:
        begun.set()
        return may_end.wait(30) and count(*row)

    monkeypatch.setattr(LadderStore, "count_match", count_slowly)
    before = ladder.backlog()
    for number in range(3):
        ladder.count(match(number))
    assert begun.wait(30)
    behind = ladder.backlog()
    may_end.set()
    ladder.close()

    assert (before.n_rows, before.lag_s) == (0, 0.0)
    assert behind.n_rows == 3
    assert behind.lag_s > 0
    assert (ladder.backlog().n_rows, ladder.backlog().lag_s) == (0, 0.0)


def test_the_standings_are_printed_from_the_store(store_url: str) -> None:
    with open_ladder(store_url, "pit", RULES) as ladder:
        for number in range(3):
            ladder.count(match(number, ending=Termination.FORFEIT))
        standings = ladder.standings()

    assert json.loads(render_ladder(store_url, "", "json")) == {"ladder": "pit", "standings": standings}
    lines = [line.split() for line in render_ladder(store_url, "pit", "text").splitlines()]
    assert [line[:2] for line in lines if line and line[0] in "12"] == [["1", "ann"], ["2", "bob"]]
    assert [line[-4:] for line in lines if line and line[0] in "12"] == [["3", "0", "0", "0"], ["0", "0", "3", "3"]]


def test_who_has_stayed_away_is_printed_as_less_sure_than_it_was(store_url: str) -> None:
    day_s = 86_400.0
    with open_ladder(store_url, "pit", RULES, clock=lambda: 1e9) as ladder:
        for number in range(100):
            ladder.count(match(number, winner=None))
        before = ladder.standings()
    with open_ladder(store_url, "pit", RULES, clock=lambda: 1e9 + 90 * day_s) as ladder:
        after = ladder.standings()

    assert after[0]["sigma"] > before[0]["sigma"]
    assert read_ladder(store_url, "pit", now_s=1e9)[1] == before
    assert read_ladder(store_url, "pit", now_s=1e9 + 90 * day_s)[1] == after


def test_a_ladder_that_is_not_there_is_named(store_url: str) -> None:
    LadderStore(store_url).__exit__()

    with pytest.raises(StoreError, match="holds no ladder yet"):
        render_ladder(store_url, "", "text")
    with pytest.raises(StoreError, match="no ladder of a pit called pond"):
        render_ladder(store_url, "pond", "text")
