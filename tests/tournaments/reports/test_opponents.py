"""Against whom an entry does well or badly, and on which maps."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from made_leagues import play
from outcomes import met

from arena.game.board import parse_board
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key
from arena.game.ruleset import load
from arena.game.types import Code, Team
from arena.records.journal import Header, journal_name, write_start
from arena.records.journal_folder import JournalFolder
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.standings import stand
from tournaments.reports.formats import render, to_markdown
from tournaments.reports.map_gains import _ways, find_map_gains
from tournaments.reports.opponents import find_opponents, opponents_to_dict
from tournaments.reports.report import Report, make_report
from tournaments.store.store import StoredLeague

NAMES = ["a", "b", "c"]
RULES = load("paper")


def fixture(one: str, other: str, n_won: int, n_pairs: int = 10) -> Iterator[Outcome]:
    """Yield the pairs of two entries; the first wins both matches of so many."""
    for pair in range(n_pairs):
        for blue in (one, other):
            yield met(one, other, pair, blue, Team.BLUE if (blue == one) is (pair < n_won) else Team.RED, league="friday")


def league(outcomes: list[Outcome], n_pairs: int) -> Report:
    facts = {"ruleset": "paper", "rules": "0", "entries": dict.fromkeys(NAMES, "rush"), "secret": "0"}
    stored = StoredLeague(id=1, name="friday", hash="0", n_pairs=n_pairs, definition=facts)
    return make_report(stored, outcomes, n_draws=20, rating_method="normal")


def test_opponents_stand_out_by_points_and_by_what_the_ratings_expect() -> None:
    """All three win half their matches, so each is expected to score half against each."""
    outcomes = [*fixture("a", "b", 9), *fixture("b", "c", 9), *fixture("a", "c", 1)]

    found = find_opponents(stand(NAMES, outcomes, n_draws=20))

    assert (found["a"].best.name, found["a"].worst.name) == ("b", "c")
    assert (found["a"].most_above, found["a"].most_below) == (found["a"].best, found["a"].worst)
    assert found["b"].best.score == pytest.approx(0.9)
    assert found["b"].best.expected == pytest.approx(0.5, abs=1e-6)
    assert found["b"].best.is_significant
    assert found["b"].best.z == pytest.approx(-found["c"].worst.z)


def test_the_weakest_is_the_best_opponent_and_no_surprise() -> None:
    outcomes = play((300, 0, -300), 30, np.random.default_rng(1))

    found = find_opponents(stand(["00", "01", "02"], outcomes, n_draws=20))

    assert (found["00"].best.name, found["00"].worst.name) == ("02", "01")
    assert not found["00"].best.is_significant


def test_who_met_one_opponent_has_no_best() -> None:
    report = league([*fixture("a", "b", 2, 4)], 4)

    assert find_opponents(report.standings) == {}
    assert "Best and worst opponents" not in to_markdown(report)


def test_a_report_tells_the_opponents(tmp_path: Path) -> None:
    report = league([*fixture("a", "b", 9), *fixture("b", "c", 9), *fixture("a", "c", 1)], 10)
    page, text, document = (render(report, form, tmp_path / "a.html", tmp_path) for form in ("html", "md", "json"))

    assert json.loads(document)["opponents"] == opponents_to_dict(find_opponents(report.standings))
    assert "map_gains" not in json.loads(document)
    assert "On which maps" not in page
    for told in (page, text):
        assert "b 0.900 (0.500)" in told


def header(outcome: Outcome) -> Header:
    """Return the header of a match, whose map is that of its pair."""
    match = LeagueMatchId.parse(outcome.identity)
    keys = MatchKeys(map_key=derive_map_key(b"s" * 32, match.fixture, match.pair), match_key=b"m" * 32)
    return Header(identity=outcome.identity, blue=outcome.blue, red=outcome.red, ruleset=RULES, keys=keys)


def n_obstacles(outcome: Outcome) -> int:
    games = BatchedGame(RULES, 1)
    games.start([0], [header(outcome).keys])
    return int((games.truth(0) == Code.OBSTACLE).sum())


@pytest.fixture(scope="module")
def walled() -> Report:
    """Return a league in which `a` wins nine pairs of ten on maps with many obstacles, and one of ten on others."""
    rng = np.random.default_rng(2)
    outcomes = [*fixture("a", "b", 0, 24), *fixture("a", "c", 0, 24), *fixture("b", "c", 12, 24)]
    count = {one.identity: n_obstacles(one) for one in outcomes}
    middle = np.median(list(count.values()))
    played = []
    for blue, red in zip(outcomes[::2], outcomes[1::2], strict=True):
        match = LeagueMatchId.parse(blue.identity)
        has_won = rng.random() < (0.9 if count[blue.identity] > middle else 0.1) if match.one == "a" else match.pair % 2 == 0
        played += [
            met(match.one, match.other, match.pair, one.blue, Team.BLUE if (one.blue == match.one) is bool(has_won) else Team.RED,
                league="friday")
            for one in (blue, red)
        ]  # fmt: skip
    return league(played, 24)


def test_what_an_entry_gains_where_there_are_many_obstacles_is_found(walled: Report, tmp_path: Path) -> None:
    for outcome in walled.outcomes:
        (tmp_path / journal_name(outcome.identity)).write_bytes(write_start(header(outcome), b"", b"")[0])

    found = {(gain.entry, gain.feature): gain for gain in find_map_gains(walled, JournalFolder(tmp_path))}

    gain = found["a", "obstacles"]
    assert gain.is_significant
    assert gain.gain > 0.6
    assert 0.3 < gain.low < gain.gain < gain.high
    assert gain.n_maps == 48
    assert not found["a", "way"].is_significant
    assert "On which maps" in render(walled, "html", tmp_path / "a.html", tmp_path)
    told = json.loads(render(walled, "json", tmp_path / "a.html", tmp_path))["map_gains"]
    assert told["gains"]["a"]["obstacles"]["significant"]


def test_the_way_from_flag_to_flag_goes_around_obstacles() -> None:
    straight = parse_board("......\nUA..ua\nF....f\n......\n......\n......")
    around = parse_board("..##..\nUA##ua\nF.##.f\n..##..\n..##..\n......")

    assert _ways(np.array([straight.ground, around.ground])).tolist() == [5, 11]


def test_without_journals_nothing_is_said_of_maps(walled: Report, tmp_path: Path) -> None:
    assert find_map_gains(walled, JournalFolder(tmp_path)) == ()
