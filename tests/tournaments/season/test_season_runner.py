"""A season that is played: newcomers first, nothing lost or counted twice, and versions apart."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from outcomes import ended
from pretended_season import LEAGUE, N_CORES, PretendedSeason

from arena.records.plan import LeagueMatchId, MatchPlan
from tournaments.league.season import Phase, SeasonTerms
from tournaments.league.versions import entry_of
from tournaments.outcome import Outcome
from tournaments.running.scheduler import Folders
from tournaments.season import runner
from tournaments.season.final import make_final, play_final
from tournaments.season.phases import find_phase
from tournaments.season.results import Results
from tournaments.season.runner import MOST_VOID, REST_ELO, SUSPENSION_S
from tournaments.season.service import why_not_remote
from tournaments.season.table import rate_season
from tournaments.venues.setting import EntryLostError, VenueSetting

LEAST_UNDER_WAY, MOST_UNDER_WAY = N_CORES * runner.LEAST_UNDER_WAY, N_CORES * runner.MOST_UNDER_WAY
MOST_WHEN_BUSY = N_CORES * runner.MOST_WHEN_BUSY
ELO = {"rush": 100.0, "patrol": 0.0, "random": -100.0}


@pytest.fixture
def season(tmp_path: Path) -> Iterator[PretendedSeason]:
    season = PretendedSeason(str(tmp_path / "arena.db"), tmp_path, ELO)
    with season.store:
        yield season


@pytest.fixture
def stored_season(store_url: str, tmp_path: Path) -> Iterator[PretendedSeason]:
    """Keep a season on each database in turn."""
    season = PretendedSeason(store_url, tmp_path, ELO)
    with season.store:
        yield season


def play(season: PretendedSeason, n: int) -> int:
    """Play until `n` more matches are counted, or nothing is left to be known; return how many were."""
    counted = n_idle = n_stuck = 0
    while counted < n and n_idle < 2:
        season.now_s += 10
        new = len(season.runner.step(Phase.OPEN))
        counted += new
        n_idle = 0 if new or season.runner.n_under_way else n_idle + 1
        n_stuck = 0 if new else n_stuck + 1
        assert n_stuck < 500, f"{season.runner.n_under_way} matches are under way, and none ends"
    return counted


def width(season: PretendedSeason, label: str) -> float:
    rating = season.runner.table.ratings[label]
    return rating.elo_high - rating.elo_low


def check_books(season: PretendedSeason) -> None:
    """Every match is stored once, and what is in memory is what is stored."""
    identities = season.store.identities(season.row)
    assert len(identities) == season.store.count(season.row) == season.runner.results.n_matches
    stored = sum(sum(row) for row in season.store.count_results(season.row).values())
    assert stored == len(identities)


def test_a_newcomer_plays_first_until_it_is_known(season: PretendedSeason) -> None:
    play(season, 400)
    label = season.submit("ann", "d1", 200.0)
    season.venue.given.clear()

    play(season, 60)

    met = [LeagueMatchId.parse(identity) for identity in season.venue.given]
    assert sum(label in (match.one, match.other) for match in met) > 0.8 * len(met)


def test_two_of_one_owner_never_meet(season: PretendedSeason) -> None:
    for name in ("ann", "bob"):
        season.submit(name, name, 0.0, owner="one key")
    play(season, 60)

    assert season.runner.results.record("ann").n_matches > 0
    assert season.runner.results.n_between("ann", "bob") == 0


def test_a_new_version_is_rated_by_what_it_shares_with_the_one_before_it() -> None:
    before, now = [f"e{number}" for number in range(8)], [f"e{number}.2" for number in range(8)]
    counts = {(one, other): (90, 20, 90) for one in before for other in before if one != other}
    counts |= {(one, other): (2, 0, 2) for one in now for other in before if entry_of(one) != other}
    results = Results(counts, (), {})

    apart, linked = (rate_season(results, now, follows) for follows in ((), list(zip(before, now, strict=True))))

    widths = [table.ratings["e0.2"].elo_high - table.ratings["e0.2"].elo_low for table in (apart, linked)]
    assert widths[1] < 0.8 * widths[0]


def test_a_newcomer_of_whom_nothing_is_known_makes_nobody_else_less_certain(season: PretendedSeason) -> None:
    play(season, 400)
    before = {label: width(season, label) for label in ELO}
    season.submit("ann", "d1", 0.0)
    season.runner.step(Phase.OPEN, may_choose=False)

    for label, known in before.items():
        assert width(season, label) < 1.1 * known
    assert width(season, "ann") > 500


def test_when_everybody_is_known_it_rests_until_something_changes(season: PretendedSeason) -> None:
    while play(season, 1_000) == 1_000:
        assert season.runner.results.n_matches < 20_000

    assert max(width(season, label) for label in ELO) <= REST_ELO * 1.05
    assert season.runner.n_under_way == 0
    season.submit("ann", "d1", 0.0)
    assert play(season, 10) >= 10


def test_no_two_matches_are_one_and_no_more_are_under_way_than_may_be(season: PretendedSeason) -> None:
    for _ in range(30):
        season.runner.step(Phase.OPEN)
        assert season.runner.n_under_way <= MOST_UNDER_WAY

    assert max(Counter(season.venue.given).values()) == 1
    check_books(season)


@pytest.mark.parametrize("n_before_kill", [1, 13, 40])
def test_a_season_that_was_killed_ends_the_pairs_that_were_begun(stored_season: PretendedSeason, n_before_kill: int) -> None:
    play(stored_season, n_before_kill)
    half = stored_season.runner.results.halves

    stored_season.open()
    assert stored_season.runner.n_under_way == len(half)
    play(stored_season, 100)

    check_books(stored_season)
    assert not half & stored_season.runner.results.halves


def test_matches_whose_journal_was_begun_are_taken_up_again(season: PretendedSeason) -> None:
    journals = season.folder / "journals"
    journals.mkdir()
    (journals / "course+patrol+rush+0007+patrol-blue+0.journal").touch()

    season.open()

    begun = ["course/patrol/rush/0007/patrol-blue/0", "course/patrol/rush/0007/rush-blue/0"]
    assert sorted(season.venue.given) == begun
    assert season.runner.results.take_pair("patrol", "rush") == 8
    season.submit("ann", "d1", 0.0)
    season.submit("ann", "d2", 0.0)
    (journals / "course+ann+rush+0000+ann-blue+0.journal").touch()
    season.venue.given.clear()
    season.open()
    assert sorted(season.venue.given) == begun, "a version that plays no more is called"


def test_a_new_version_takes_the_place_of_the_old_one_whose_results_and_rating_stay(stored_season: PretendedSeason) -> None:
    first = stored_season.submit("ann", "d1", 0.0)
    play(stored_season, 100)
    n_of_first = stored_season.runner.results.record(first).n_matches
    second = stored_season.submit("ann", "d2", 300.0)
    play(stored_season, 300)

    assert (first, second) == ("ann", "ann.2")
    assert first in stored_season.venue.named_gone
    ratings = stored_season.runner.table.ratings
    assert set(ratings) == {"ann.2", "patrol", "random", "rush"}
    assert ratings["ann.2"].rank == 1
    assert stored_season.runner.roster.follows == (("ann", "ann.2"),)
    [kept] = [one.rating for one in stored_season.store.versions(stored_season.row) if one.label == "ann"]
    assert kept is not None
    assert kept["matches"] == n_of_first > 0
    check_books(stored_season)


def test_whoever_goes_back_to_earlier_code_is_known_at_once(season: PretendedSeason) -> None:
    first = season.submit("ann", "d1", 0.0)
    play(season, 300)
    before = width(season, first)
    season.submit("ann", "d2", 0.0)
    play(season, 20)
    entry = season.store.find_entry(season.row, "ann")
    assert entry is not None
    season.store.play_version(season.row, entry, 1)
    season.runner.step(Phase.OPEN, may_choose=False)

    assert width(season, first) < before * 1.2
    assert season.runner.roster.fighters[first].spec == str(season.folder / "submissions/d1/bot.py")


def test_a_version_whose_matches_are_void_again_and_again_disturbs_nobody(season: PretendedSeason) -> None:
    label = season.submit("ann", "d1", 0.0)
    season.venue.broken.add(label)

    play(season, 200)

    assert season.runner.suspended == [label]
    assert season.runner.results.record(label).n_matches == 0
    assert season.runner.results.n_matches >= 200
    assert sum(label in identity for identity in season.venue.given) <= MOST_UNDER_WAY + 2 * MOST_VOID
    season.venue.broken.clear()
    assert season.submit("ann", "d2", 0.0) == "ann.2"
    play(season, 50)
    assert season.runner.results.record("ann.2").n_matches > 0


def test_a_version_whose_process_cannot_live_keeps_nobody_waiting_and_is_alone_to_blame(season: PretendedSeason) -> None:
    play(season, 40)
    label = season.submit("ann", "d1", 0.0)
    season.venue.waits_for = {label}
    while sum(label in identity for identity in season.venue.given) < MOST_VOID * (len(ELO) + 1):
        play(season, 1)
    season.venue.failing = frozenset({label})
    n_given = sum(label in identity for identity in season.venue.given)

    assert play(season, 100) >= 100
    season.venue.withdraw([label], "it cannot live")
    play(season, 100)

    assert season.runner.suspended == [label]
    assert sum(label in identity for identity in season.venue.given) == n_given
    check_books(season)


def test_after_some_time_what_was_void_is_played_again(season: PretendedSeason) -> None:
    season.venue.broken = set(ELO)  # the fault of nobody: a disk is full
    play(season, 1)
    assert season.runner.suspended == sorted(ELO)

    season.venue.broken.clear()
    season.now_s += SUSPENSION_S

    assert play(season, 50) >= 50


def test_a_match_that_was_void_once_is_played_again(season: PretendedSeason) -> None:
    season.venue.broken, season.venue.most = set(ELO), 1
    season.runner.step(Phase.OPEN)
    season.venue.broken, season.venue.most = set(), MOST_UNDER_WAY

    [(void, n_given), *_] = Counter(season.venue.given).most_common(1)
    play(season, 1)

    assert n_given == 2
    assert void in season.store.identities(season.row)


def test_the_table_says_who_forfeited_and_of_whom_little_is_known(season: PretendedSeason) -> None:
    season.venue.forfeiting = {"random"}
    season.runner.step(Phase.OPEN)
    while season.runner.n_under_way:  # no time passes
        season.runner.step(Phase.OPEN, may_choose=False)
    season.submit("ann", "d1", 0.0)

    for _ in range(2):
        season.runner.step(Phase.OPEN, may_choose=False)
        table = season.store.standings(season.row)
        assert table is not None
        forfeits = {row["label"]: row["forfeits"] for row in table["rows"]}
        assert forfeits == {"ann": 0, "patrol": 0, "random": season.runner.results.record("random").losses, "rush": 0}
        assert forfeits["random"] > 0
        assert table["matches"] == season.runner.results.n_matches
        assert [row["is_new"] for row in table["rows"]] == [row["elo_high"] - row["elo_low"] > 100 for row in table["rows"]]
        season.open()


def test_what_is_under_way_is_not_chosen_as_if_it_were_not(season: PretendedSeason) -> None:
    journals = season.folder / "journals"
    journals.mkdir()
    for pair in range((LEAST_UNDER_WAY - 1) // 2):
        (journals / f"course+patrol+rush+{pair:04}+patrol-blue+0.journal").touch()
    season.venue.most = 0
    season.open()
    season.runner.step(Phase.OPEN)

    assert season.runner.n_under_way == MOST_UNDER_WAY
    assert sum("/patrol/rush/" in identity for identity in season.venue.given) < MOST_UNDER_WAY / 2


def test_versions_that_go_and_come_back_before_they_could_play_keep_nobody_from_playing(season: PretendedSeason) -> None:
    season.venue.most = 0
    first = season.submit("ann", "d1", 0.0)
    season.runner.step(Phase.OPEN)
    second = season.submit("ann", "d2", 0.0)
    season.runner.step(Phase.OPEN)
    entry = season.store.find_entry(season.row, "ann")
    assert entry is not None
    season.store.play_version(season.row, entry, 1)
    season.runner.step(Phase.OPEN)

    season.venue.most = MOST_UNDER_WAY
    season.runner.step(Phase.OPEN)
    assert season.runner.suspended == []
    play(season, 100)

    assert season.runner.results.record(first).n_matches > 0
    assert season.runner.results.record(second).n_matches == 0
    check_books(season)


def test_an_entry_that_joins_by_itself_is_chosen_while_it_is_there(season: PretendedSeason) -> None:
    key = "key:" + "A" * 42 + "E"
    given = season.store.submit(season.row, entry="far", owner="k", digest="d", n_bytes=0, now_s=1.0)
    season.store.accept(season.row, given, spec=key, says="", report=None, now_s=1.0)
    season.venue.elo["far"] = 0.0
    play(season, 50)
    assert season.runner.results.record("far").n_matches == 0
    assert "far" in season.venue.known, "it cannot come"

    season.venue.present = frozenset({"far"})
    play(season, 50)

    assert season.runner.results.record("far").n_matches > 0


def test_no_more_think_at_once_than_the_cores_have_time_for(season: PretendedSeason) -> None:
    for name in ("ann", "bob"):
        report = {"times": {"median_ms": 100.0}}
        given = season.store.submit(season.row, entry=name, owner=name, digest=name, n_bytes=1, now_s=1.0)
        season.store.accept(season.row, given, spec=f"key:{'A' * 42}E", says="", report=report, now_s=1.0)
        season.venue.elo[name] = 0.0
    season.venue.present = frozenset({"ann", "bob"})
    season.venue.most = 0

    season.runner.step(Phase.OPEN)

    think_s = sum(0.1 * (name in identity) for identity in season.venue.given for name in ("/ann/", "/bob/"))
    assert 0 < think_s <= 0.5 * N_CORES  # half of the turn time
    assert len(season.venue.given) < MOST_UNDER_WAY


def test_while_submissions_are_checked_little_is_played_beside(season: PretendedSeason) -> None:
    season.venue.most = 0
    for _ in range(5):
        season.runner.step(Phase.OPEN, is_busy=True)

    assert season.runner.n_under_way == MOST_WHEN_BUSY


def test_whoever_joins_by_itself_and_leaves_keeps_nobody_waiting(season: PretendedSeason) -> None:
    given = season.store.submit(season.row, entry="far", owner="k", digest="d", n_bytes=0, now_s=1.0)
    season.store.accept(season.row, given, spec=f"key:{'A' * 42}E", says="", report=None, now_s=1.0)
    season.venue.elo["far"] = 0.0
    season.venue.present = frozenset({"far"})
    season.venue.most = 0
    season.runner.step(Phase.OPEN)
    assert any("/far/" in identity for identity in season.venue.given)

    season.venue.present = frozenset()
    season.venue.waits_for = {"far"}
    season.venue.most = 8
    play(season, 300)

    assert season.venue.named_gone == {"far"}
    assert season.runner.results.n_matches >= 300
    assert "far" not in season.runner.suspended
    check_books(season)


def test_a_clock_that_is_set_back_neither_stops_the_table_nor_prolongs_a_suspension(season: PretendedSeason) -> None:
    season.venue.broken = {"rush"}
    play(season, 40)
    assert season.runner.suspended == ["rush"]
    season.venue.broken.clear()
    season.venue.most = 1  # something is always under way

    season.set_back_s = 10 * SUSPENSION_S
    play(season, 40)
    season.now_s += SUSPENSION_S
    season.runner.step(Phase.OPEN)

    document = season.store.standings(season.row)
    assert document is not None
    assert document["matches"] > season.runner.results.n_matches - 10
    assert season.runner.suspended == []


def test_the_public_table_stands_still_while_the_season_is_frozen(season: PretendedSeason) -> None:
    play(season, 40)
    before = season.store.standings(season.row)
    season.now_s += 100
    while len(season.runner.step(Phase.FROZEN)) < 1:
        season.now_s += 10
    season.now_s += 100
    season.runner.step(Phase.FROZEN)
    frozen = season.store.standings(season.row)

    assert before is not None
    assert frozen is not None
    assert frozen["rows"] == before["rows"]
    assert frozen["matches"] == before["matches"] < season.runner.results.n_matches
    assert (before["phase"], frozen["phase"]) == ("open", "frozen")


def test_the_final_is_a_league_of_who_plays_now_with_strangers_behind_walls_and_a_secret_of_its_own(
    season: PretendedSeason,
) -> None:
    for name, digest in (("ann", "d1"), ("bob", "d2"), ("ann", "d3")):
        season.submit(name, digest, 0.0)
    bob = season.store.find_entry(season.row, "bob")
    assert bob is not None
    season.store.withdraw(season.row, bob)

    final = make_final(LEAGUE, season.open().roster)

    assert list(final.entries) == ["ann", "patrol", "random", "rush"]
    assert final.entries["ann"] == str(season.folder / "submissions/d3/bot.py")
    assert final.sandboxes == {"ann": LEAGUE.strangers_sandbox}
    assert (final.name, final.n_pairs, final.seed, final.secret, final.season) == ("course-final", 10, None, None, None)


def test_phases_follow_the_terms_and_the_final_waits_for_what_came_in_time() -> None:
    terms = SeasonTerms(deadline_s=100.0, freeze_s=50.0)
    at = [(0.0, 0), (60.0, 0), (101.0, 2), (101.0, 0)]

    assert [find_phase(terms, now_s, n_waiting=n).value for now_s, n in at] == ["open", "frozen", "frozen", "final"]
    assert find_phase(SeasonTerms(), 1e12, n_waiting=0) is Phase.OPEN


def test_the_final_is_played_without_whoever_does_not_come_and_its_secret_is_known_then(
    season: PretendedSeason, tmp_path: Path
) -> None:
    season.submit("ann", "d1", 0.0)
    (season.folder / "submissions" / "d1" / "bot.py").touch()
    season.runner.step(Phase.OPEN)
    tried: list[set[str]] = []

    def play(_: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        tried.append({plan.blue for plan in plans})
        for plan in plans:
            if "ann" not in (plan.blue, plan.red):
                yield ended(plan.identity, plan.blue, plan.red, None)
        if "ann" in tried[-1]:
            raise EntryLostError("ann", "ann has not come")

    folders = Folders(data=tmp_path)
    played = list(play_final(LEAGUE, season.runner.roster, season.store, folders, play, is_stopped=lambda: False))

    final = season.store.get("course-final")
    assert tried == [{"ann", *ELO}]
    assert len(played) == len({outcome.identity for outcome in played}) == season.store.count(final)
    assert set(final.labels.values()) == set(ELO)
    assert final.secret is not None
    assert list(play_final(LEAGUE, season.runner.roster, season.store, folders, play, is_stopped=lambda: False)) == []
    assert len(tried) == 1


def test_remote_entries_are_refused_where_nobody_can_join() -> None:
    fresh = replace(LEAGUE, maps="fresh")

    assert "no address" in why_not_remote(fresh, "network")
    assert "nobody joins" in why_not_remote(replace(fresh, listen="tcp/127.0.0.1:1"), "local")
    assert not why_not_remote(replace(fresh, listen="tcp/127.0.0.1:1"), "network")
