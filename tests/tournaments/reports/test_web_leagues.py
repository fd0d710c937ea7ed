"""The leagues of a store as the web page gets them: no journal while another match may be on its map."""

from pathlib import Path
from shutil import copytree

import pytest
from commands import run_here
from outcomes import met

from arena.display.replay_frames import describe_match
from arena.errors import ArenaError, UnknownNameError
from arena.game.types import Team, Termination
from arena.pit.ladder import LadderMatch
from arena.policy import MatchResult
from arena.records.journal import read_journal
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.skill import LadderEntry, rate
from tournaments.reports.tags import COMEBACK_SCORE
from tournaments.reports.web_leagues import Leagues
from tournaments.store.store import Store

LEAGUE = """
pairs = 2
venue = "local"
seed = 3
[rules]
side = 10
tick_limit = 20
[entries]
rush = "rush"
random = "random"
"""

DUEL = """
pairs = 64
pairing = "sprt"
venue = "local"
seed = 3
entries = ["rush", "random"]
[rules]
side = 10
tick_limit = 20
[sprt]
elo1 = 400
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Play a league and a test of two entries, and keep their data as they are."""
    folder = tmp_path_factory.mktemp("finished")
    for name, text in (("friday", LEAGUE), ("better", DUEL)):
        (folder / f"{name}.toml").write_text(text)
        run_here("tournament", "run", folder / f"{name}.toml", "--data", folder / name)
    return folder


@pytest.fixture
def data(finished: Path, tmp_path: Path) -> Path:
    """Lend a league that is over; what a test changes, it changes in a copy."""
    return copytree(finished / "friday", tmp_path / "friday")


@pytest.fixture
def duel(finished: Path, tmp_path: Path) -> Path:
    return copytree(finished / "better", tmp_path / "better")


def test_where_there_is_no_store_there_are_no_leagues(tmp_path: Path) -> None:
    assert Leagues(tmp_path, "").names() == []


def test_a_finished_league_gives_its_report_and_its_journals(data: Path) -> None:
    leagues = Leagues(data, "")

    assert leagues.names() == ["friday"]
    report = leagues.report("friday")
    assert report["matches"]["complete"]
    assert len(report["results"]) == report["matches"]["played"] == 4
    for result in report["results"]:
        journal = read_journal(leagues.journal("friday", result["identity"]))
        assert journal.header.identity == result["identity"]


def test_a_raised_number_of_pairs_is_seen_though_no_match_was_played_since(data: Path) -> None:
    leagues = Leagues(data, "")
    assert leagues.report("friday")["matches"]["complete"]

    with Store(str(data / "arena.db")) as store:
        store.enter("friday", store.get("friday").definition, 9)

    assert leagues.report("friday")["matches"] | {"complete": False, "planned": 18} == leagues.report("friday")["matches"]


def test_two_entries_are_compared_by_their_current_versions_where_a_league_has_earlier_ones(tmp_path: Path) -> None:
    facts = {"ruleset": "paper", "rules": "1", "clock": {}}
    with Store(str(tmp_path / "arena.db")) as store:
        for label, code in (("ann", "0" * 64), ("ann.2", "1" * 64)):
            league = store.enter("course", {**facts, "entries": {"ann": f"ann.py {code}", "rush": "rush"}}, 1)
            for blue in (label, "rush"):
                store.add(league, met(label, "rush", 0, blue, Team.BLUE, league="course"))
    leagues = Leagues(tmp_path, "")

    assert leagues.head_to_head("course", "ann.2", "rush")["record"]["pairs"] == 1
    with pytest.raises(UnknownNameError, match="unknown entry 'ann'"):
        leagues.head_to_head("course", "ann", "rush")


def test_the_report_of_a_league_that_is_closed_tells_its_secret(data: Path) -> None:
    leagues = Leagues(data, "")
    assert leagues.report("friday")["league"]["secret"] is None

    with Store(str(data / "arena.db")) as store:
        store.close(store.get("friday"), bytes(32))

    assert leagues.report("friday")["league"]["secret"] == bytes(32).hex()


def test_a_decided_test_shows_the_journals_of_its_whole_pairs(duel: Path) -> None:
    leagues = Leagues(duel, "")
    report = leagues.report("better")
    n_played = len(report["results"])

    assert (report["sprt"]["verdict"], n_played < report["matches"]["planned"] == 128) == ("accepted", True)
    for result in report["results"]:
        read_journal(leagues.journal("better", result["identity"]))

    with Store(str(duel / "arena.db")) as store:
        row = store.get("better")
        outcomes = store.outcomes(row)
    other = duel / "running.db"
    with Store(str(other)) as store:
        running = store.enter("better", row.definition, row.n_pairs)
        for outcome in outcomes[:-1]:
            store.add(running, outcome)
    running_leagues = Leagues(duel, str(other))
    assert running_leagues.journal("better", outcomes[0].identity)
    with pytest.raises(ArenaError, match="until the last match of these two is over"):
        running_leagues.journal("better", outcomes[-2].identity)


def test_matches_beyond_the_deciding_pair_of_a_test_count_between_its_entries_no_more_than_in_its_table(duel: Path) -> None:
    leagues = Leagues(duel, "")
    report = leagues.report("better")

    met = leagues.head_to_head("better", "rush", "random")

    assert report["sprt"]["matches_beyond"] > 0
    assert met["record"]["pairs"] == report["sprt"]["pairs"]
    assert {key: met["record"][key] for key in ("wins", "draws", "losses")} == {
        key: report["cross"]["rush"]["random"][key] for key in ("wins", "draws", "losses")
    }


@pytest.fixture
def half(data: Path) -> Path:
    """Return a store of the league as it was before its last match."""
    with Store(str(data / "arena.db")) as store:
        league = store.get("friday")
        outcomes = store.outcomes(league)
    with Store(str(data / "half.db")) as store:
        running = store.enter("friday", league.definition, league.n_pairs)
        for outcome in outcomes[:-1]:
            store.add(running, outcome)
    return data / "half.db"


def test_tags_of_how_a_match_went_come_from_its_journal_once_that_may_be_seen(data: Path, half: Path) -> None:
    leagues = Leagues(data, "")
    expected = []
    for match in (matches := leagues.head_to_head("friday", "rush", "random")["matches"]):
        told = describe_match(leagues.journal("friday", match["identity"]))
        scores = [tick["score"] * (1 if match["winner"] == "blue" else -1) for tick in told["ticks"]]
        is_comeback = match["winner"] is not None and min(scores) <= -COMEBACK_SCORE
        is_peaceful = not any(tick["events"]["fought"] for tick in told["ticks"])
        expected.append({*(["comeback"] if is_comeback else []), *(["no contact"] if is_peaceful else [])})

    found = [{tag["name"] for tag in match["tags"]} for match in matches]
    of_course = {"comeback", "no contact"}
    assert [tags & of_course for tags in found] == expected
    assert any(expected), "no match here has a tag: choose another seed"
    early = Leagues(data, str(half)).head_to_head("friday", "rush", "random")["matches"]
    assert len(early) == len(matches) - 1
    assert not any({tag["name"] for tag in match["tags"]} & of_course for match in early)
    with pytest.raises(UnknownNameError, match="did you mean 'rush'"):
        leagues.head_to_head("friday", "rusch", "random")


def test_ladders_are_listed_the_last_first_and_ranked(tmp_path: Path) -> None:
    url = str(tmp_path / "arena.db")
    assert Leagues(tmp_path, url).ladders() == []
    with LadderStore(url) as store:
        for number, ladder in enumerate(("old", "new")):
            seats = {team: LadderEntry(key=f"{team:043}", name=team.name.lower()) for team in Team}
            result = MatchResult(ending=Termination.CAPTURE, winner=Team.RED, score=-100, ticks=9)
            match = LadderMatch(
                identity=f"{ladder}/ladder/{number:06}/blue/red",
                names={team: seats[team].name for team in Team},
                entries=dict.fromkeys(Team, bytes(32)),
                rules_hash="00",
                result=result,
            )
            store.count_match(ladder, match, rate(seats, result))
    leagues = Leagues(tmp_path, url)

    assert leagues.ladders() == ["new", "old"]
    board = leagues.ladder("old")["leaderboard"]
    names = [column["name"] for column in board["columns"]]
    rows = [dict(zip(names, (cell["text"] for cell in row), strict=True)) for row in board["rows"]]
    assert [(row["rank"], row["entry"], row["wins"], row["losses"]) for row in rows] == [(1, "red", 1, 0), (2, "blue", 0, 1)]


def test_no_journal_is_given_before_the_last_match_of_two_entries(data: Path, half: Path) -> None:
    with Store(str(data / "arena.db")) as store:
        outcomes = store.outcomes(store.get("friday"))
    leagues = Leagues(data, str(half))

    with pytest.raises(ArenaError, match="until the last match of these two is over"):
        leagues.journal("friday", outcomes[0].identity)
    with pytest.raises(ArenaError, match="has no match"):
        leagues.journal("friday", outcomes[-1].identity)
