"""A league from its file to its report: stored once, resumed, told alike."""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from itertools import islice
from pathlib import Path
from urllib.parse import unquote

import pytest
from outcomes import changed, ended
from sqlalchemy import text

from arena.errors import ArenaError, UnknownNameError
from arena.game.types import Team, Termination
from arena.records.plan import MatchPlan
from tournaments.league.file import parse_league
from tournaments.league.league import League
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.reports.formats import to_json, to_text
from tournaments.reports.page import MOST_LISTED, to_html
from tournaments.reports.report import Report, make_report, to_document
from tournaments.running.scheduler import MOST_ROUNDS, Folders, Scheduler
from tournaments.store.store import Store, StoreError
from tournaments.venues.local import play as play_local
from tournaments.venues.setting import VenueSetting

Arena = Callable[..., subprocess.CompletedProcess[str]]
LEAGUE = 'pairs = 2\nseed = 1\nentries = ["rush", "patrol", "random"]\n[rules]\ntick_limit = 20'


def parse(toml: str = LEAGUE) -> League:
    return parse_league(toml, "friday", Path())


def pretend(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """End matches without playing them: the first name in the alphabet wins."""
    for plan in plans:
        seats = {team: SeatOutcome(faults={"late": 1}, latency_p50_s=0.001, latency_p99_s=0.002) for team in Team}
        winner = Team.BLUE if plan.blue < plan.red else Team.RED
        yield ended(plan.identity, plan.blue, plan.red, winner, seats, score=100, ticks=3)


def run(folder: Path, venue: Callable[..., Iterator[Outcome]], *, league: League | None = None, n: int | None = None) -> Report:
    """Run a league, or only until `n` more matches are stored."""
    league = league or parse()
    folder.mkdir(exist_ok=True)
    with Store(str(folder / "arena.db")) as store, Scheduler(league, store, Folders(data=folder)) as scheduler:
        for _ in islice(scheduler.run(venue), n):
            pass
        return make_report(scheduler.row, store.outcomes(scheduler.row), n_draws=50)


def without_wall(report: Report) -> str:
    facts = json.loads(to_json(report))
    del facts["wall"]
    return json.dumps(facts)


@pytest.mark.usefixtures("one_core")
def test_a_league_that_was_stopped_ends_in_the_same_report(tmp_path: Path) -> None:
    undisturbed = run(tmp_path / "one", play_local)

    partial = run(tmp_path / "two", play_local, n=5)
    again = run(tmp_path / "two", play_local, n=1)
    finished = run(tmp_path / "two", play_local)

    assert (partial.standings.n_matches, again.standings.n_matches, finished.standings.n_matches) == (5, 6, 12)
    assert without_wall(finished) == without_wall(undisturbed)


def test_what_is_stored_is_not_played_again(tmp_path: Path) -> None:
    run(tmp_path, pretend, n=7)
    asked = []

    def watch(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        asked.append(len(plans))
        return pretend(setting, plans)

    run(tmp_path, watch)
    run(tmp_path, watch)

    assert asked == [5]


def test_more_pairs_go_on_and_fewer_are_refused(tmp_path: Path) -> None:
    run(tmp_path, pretend)

    assert run(tmp_path, pretend, league=replace(parse(), n_pairs=3)).standings.n_matches == 18
    with pytest.raises(StoreError, match="pairs were lowered"):
        run(tmp_path, pretend)


@pytest.mark.parametrize(
    ("edit", "named"),
    [
        (("seed = 1", "seed = 2"), "seed or secret"),
        (("tick_limit = 20", "tick_limit = 21"), "rules"),
    ],
)
def test_an_edited_league_is_refused_and_nothing_is_lost(tmp_path: Path, edit: tuple[str, str], named: str) -> None:
    run(tmp_path, pretend, n=3)

    with pytest.raises(StoreError, match=named):
        run(tmp_path, pretend, league=parse(LEAGUE.replace(*edit)))

    assert run(tmp_path, pretend).is_complete


def play_versions(folder: Path, *steps: tuple[str, int | None]) -> tuple[list[set[str]], Report]:
    """Run leagues of these entries one after another, each until so many matches; return what was asked for, and the report."""
    asked: list[set[str]] = []

    def watch(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        asked.append({plan.identity for plan in plans})
        return pretend(setting, plans)

    for entries, n in steps:
        league = parse(f"pairs = 2\nseed = 1\n[entries]\n{entries}\n[rules]\ntick_limit = 20")
        report = run(folder, watch, league=league, n=n)
    return asked, report


AB, ABC = 'a = "rush"\nb = "patrol"', 'a = "rush"\nb = "patrol"\nc = "random"'
ANEW = ABC.replace("patrol", "spiral")


def test_after_an_edit_only_new_fixtures_are_played_and_the_table_rates_current_versions(tmp_path: Path) -> None:
    asked, report = play_versions(tmp_path, (ABC, None), (ANEW, None))

    assert len(asked[0]) == 12
    assert {tuple(identity.split("/")[1:3]) for identity in asked[1]} == {("a", "b.2"), ("b.2", "c")}
    assert len(asked[1]) == 8
    assert sorted(row.name for row in report.standings.rows) == ["a", "b.2", "c"]
    assert (report.standings.n_matches, report.n_planned, report.n_earlier) == (12, 12, 8)
    assert "8 matches of earlier versions are stored and not counted" in to_text(report)


def test_an_entry_that_is_added_or_taken_out_leaves_the_other_results_alone(tmp_path: Path) -> None:
    asked, more = play_versions(tmp_path, (AB, None), (ABC, None))
    _, fewer = play_versions(tmp_path, (AB, None))

    assert [len(plans) for plans in asked] == [4, 8]
    assert (more.standings.n_matches, more.n_earlier) == (12, 0)
    assert (fewer.standings.n_matches, fewer.n_earlier, fewer.is_complete) == (4, 8, True)


def test_who_goes_back_to_earlier_code_has_its_results_back(tmp_path: Path) -> None:
    asked, report = play_versions(tmp_path, (ABC, None), (ANEW, None), (ABC, None))

    assert len(asked) == 2
    assert sorted(row.name for row in report.standings.rows) == ["a", "b", "c"]
    assert report.is_complete


@pytest.mark.parametrize("stops", [(0, 3), (5, 0), (7, 4)])
def test_versions_that_were_stopped_anywhere_end_in_the_same_report(tmp_path: Path, stops: tuple[int, int]) -> None:
    _, straight = play_versions(tmp_path / "one", (ABC, 7), (ANEW, None))
    _, stopped = play_versions(tmp_path / "two", (ABC, stops[0]), (ABC, 7 - stops[0]), (ANEW, stops[1]), (ANEW, 1), (ANEW, None))

    assert without_wall(stopped) == without_wall(straight)


def test_every_version_is_rated_when_that_is_asked_for(tmp_path: Path) -> None:
    play_versions(tmp_path, (ABC, None), (ANEW, None))
    with Store(str(tmp_path / "arena.db")) as store:
        row = store.latest()
        report = make_report(row, store.outcomes(row), n_draws=50, has_all_versions=True)
        numbers = [(one.entry, one.number) for one in store.versions(row)]

    assert sorted(row.name for row in report.standings.rows) == ["a", "b", "b.2", "c"]
    assert (report.standings.n_matches, report.is_complete) == (20, True)
    assert numbers == [("a", 1), ("b", 1), ("b", 2), ("c", 1)]


def test_code_that_never_played_a_match_leaves_no_version(tmp_path: Path) -> None:
    _, report = play_versions(tmp_path, (ABC, 0), (ANEW, None))

    assert sorted(row.name for row in report.standings.rows) == ["a", "b", "c"]


def test_a_void_match_is_played_again_and_never_stored(tmp_path: Path) -> None:
    rounds: list[int] = []

    def spoil(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        rounds.append(len(plans))
        for number, outcome in enumerate(pretend(setting, plans)):
            is_spoiled = len(rounds) == 1 and number < 5
            yield changed(outcome, ending=Termination.VOID, winner=None) if is_spoiled else outcome

    report = run(tmp_path, spoil)

    assert rounds == [12, 5]
    assert report.standings.endings == {"capture": 12}


def test_matches_that_stay_void_end_the_run_with_a_sentence(tmp_path: Path) -> None:
    def spoil(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        for outcome in pretend(setting, plans):
            yield changed(outcome, ending=Termination.VOID, winner=None)

    with pytest.raises(ArenaError, match=f"12 matches of league friday were void {MOST_ROUNDS} times"):
        run(tmp_path, spoil)
    with Store(str(tmp_path / "arena.db")) as store:
        assert store.count(store.latest()) == 0


def test_a_match_counts_once(tmp_path: Path) -> None:
    with Store(str(tmp_path / "arena.db")) as store:
        league = store.enter("friday", parse().definition, 2)
        outcome = next(pretend(None, [MatchPlan(identity="friday/a/b/0000/a-blue/0", blue="a", red="b", keys=None)]))  # type: ignore[arg-type]

        assert store.add(league, outcome)
        assert not store.add(league, changed(outcome, winner=None))
        assert store.outcomes(league) == [outcome]
        with pytest.raises(ValueError, match="void"):
            store.add(league, changed(outcome, ending=Termination.VOID))


def test_a_lock_keeps_a_second_scheduler_off_a_league_and_no_other(tmp_path: Path) -> None:
    with Store(str(tmp_path / "arena.db")) as store:
        refused = pytest.raises(ArenaError, match="another scheduler runs league friday")
        with store.lock("friday"), store.lock("monday"), refused, store.lock("friday"):
            pass
        with store.lock("friday"):
            pass


def test_a_lock_dies_with_its_process(tmp_path: Path) -> None:
    db = str(tmp_path / "arena.db")
    code = (
        "import sys, time; from tournaments.store.store import Store\n"
        "with Store(sys.argv[1]) as store, store.lock('friday'): print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", code, db], stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with Store(db) as store:
            with pytest.raises(ArenaError), store.lock("friday"):
                pass
            holder.kill()
            holder.wait()
            with store.lock("friday"):
                pass


def test_a_full_disk_is_one_sentence_and_nothing_is_lost(tmp_path: Path) -> None:
    run(tmp_path, pretend, n=2)
    with Store(str(tmp_path / "arena.db")) as store:
        league = store.latest()
        with store._engine.connect() as connection:
            connection.execute(text("PRAGMA max_page_count = 1"))  # no page more than there are, on this pooled connection
        [outcome] = pretend(None, [MatchPlan(identity="x", blue="a", red="b", keys=None)])  # type: ignore[arg-type]
        with pytest.raises(StoreError, match="disk is full"):
            store.add(league, changed(outcome, reason="x" * 100_000))
        assert store.count(league) == 2


def test_a_read_only_store_can_be_read_and_says_why_it_cannot_be_written(tmp_path: Path) -> None:
    run(tmp_path, pretend, n=2)

    with Store(f"sqlite:///file:{tmp_path / 'arena.db'}?mode=ro&uri=true", make=False) as store:
        league = store.latest()
        assert store.count(league) == 2
        with pytest.raises(StoreError, match="readonly"):
            store.enter("friday", league.definition, 2)


def test_a_store_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "junk.db").write_text("junk" * 1_000)
    for url in (str(tmp_path / "junk.db"), "postgresql://here/arena", "nonsense://", str(tmp_path)):
        with pytest.raises(StoreError):
            Store(url)
    with pytest.raises(StoreError, match="no results yet"):
        Store(str(tmp_path / "gone.db"), make=False)


def test_the_nearest_league_is_named(tmp_path: Path) -> None:
    run(tmp_path, pretend)
    with Store(str(tmp_path / "arena.db")) as store, pytest.raises(UnknownNameError, match="did you mean 'friday'"):
        store.get("fridy")


def test_the_document_holds_what_it_promises(tmp_path: Path) -> None:
    facts = json.loads(to_json(run(tmp_path, pretend)))

    assert list(facts) == [
        "format", "league", "matches", "standings", "cross", "superiority", "side", "draw_rate", "residuals", "opponents",
        "cycles", "wall",
    ]  # fmt: skip
    assert facts["matches"] == {"played": 12, "planned": 12, "complete": True, "ticks": 36, "endings": {"capture": 12}}
    assert [row["entry"] for row in facts["standings"]] == ["patrol", "random", "rush"]
    best = facts["standings"][0]
    assert {name: best[name] for name in ("rank", "wins", "draws", "losses", "points", "score")} == {
        "rank": 1,
        "wins": 8,
        "draws": 0,
        "losses": 0,
        "points": 8.0,
        "score": 1.0,
    }
    assert best["elo_low"] <= best["elo"] <= best["elo_high"]
    assert best["faults"]["late"] == 8
    assert facts["cross"]["rush"]["patrol"] == {"wins": 0, "draws": 0, "losses": 4, "score": 0.0}
    assert facts["wall"]["latency"]["rush"] == {"p50_s": 0.001, "p99_s": 0.002}
    assert "secret" in facts["league"]


def test_the_text_names_every_entry(tmp_path: Path) -> None:
    said = to_text(run(tmp_path, pretend))

    assert all(name in said for name in ("rush", "patrol", "random", "late", "p99 ms", "since its referee", "12 matches"))


class Reader(HTMLParser):
    """What a browser would see, as far as it matters here."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [str(value) for name, value in attrs if name in ("href", "src")]
        if tag not in ("meta", "link", "line", "circle"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def read_page(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


@pytest.mark.usefixtures("one_core")
def test_the_page_fetches_nothing_and_its_links_lead_to_journals(tmp_path: Path) -> None:
    report = run(tmp_path, play_local)
    place = tmp_path / "reports" / "friday.html"

    page = to_html(report, place, tmp_path / "journals" / "friday")

    links = {link for link in read_page(page).links if link not in ("data:,", "#matches")}
    assert len(links) == 12 + 1
    assert all((place.parent / unquote(link)).resolve().exists() for link in links)
    outside_scripts = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"https?:|[\"'(\s]//", outside_scripts)


def test_a_name_that_is_markup_stays_text(tmp_path: Path) -> None:
    report = run(tmp_path, pretend)
    evil = "<script>alert(1)</script>"
    names = {"rush": evil, "patrol": "patrol", "random": "random"}
    outcomes = [replace(changed(one, reason=evil), blue=names[one.blue], red=names[one.red]) for one in report.outcomes]
    league = replace(
        report.league, name=evil, definition={**report.league.definition, "entries": dict.fromkeys(names.values(), "rush")}
    )

    page = to_html(make_report(league, outcomes, n_draws=10), tmp_path / "page.html", tmp_path / evil)

    assert evil not in page
    assert read_page(page).tags.count("script") == 1


def test_a_large_league_lists_no_matches(tmp_path: Path) -> None:
    report = run(tmp_path, pretend)
    many = replace(report, standings=replace(report.standings, n_matches=MOST_LISTED + 1))

    assert "<details>" in to_html(report, tmp_path / "a.html", tmp_path)
    assert "<details>" not in to_html(many, tmp_path / "a.html", tmp_path)


def test_a_league_without_results_has_a_report(tmp_path: Path) -> None:
    report = run(tmp_path, pretend, n=0)

    assert to_document(report)["matches"]["played"] == 0
    assert "not over" in to_text(report)
    read_page(to_html(report, tmp_path / "a.html", tmp_path))


def test_the_commands_play_a_league_and_tell_it_alike(arena: Arena, here: Arena, tmp_path: Path) -> None:
    file, data = tmp_path / "friday.toml", tmp_path / "data"
    file.write_text(LEAGUE)

    ran = arena("tournament", "run", file, "--venue", "local", "--data", data, "--json")
    told = here("tournament", "report", file, "--data", data, "--json")
    led = here("leaderboard", "--data", data)
    status = here("tournament", "status", "--data", data, "--json")
    out = here("leaderboard", "--league", "friday", "--data", data, "--format", "html", "--out", tmp_path / "page.html")

    documents = [json.loads(done.stdout) for done in (ran, told)]
    for document in documents:
        del document["wall"]
    assert documents[0] == documents[1]
    assert documents[0]["league"]["secret"] is None
    assert all(name in led.stdout for name in ("rush", "patrol", "random"))
    assert json.loads(status.stdout) == [{"league": "friday", "entries": 3, "played": 12, "planned": 12, "complete": True}]
    assert [done.returncode for done in (ran, told, led, status, out)] == [0] * 5
    assert (data / "reports" / "friday.html").is_file()
    assert (tmp_path / "page.html").is_file()
    assert len(list((data / "journals" / "friday").glob("*.journal"))) == 12


def test_the_commands_refuse_in_one_sentence(here: Arena, tmp_path: Path) -> None:
    file = tmp_path / "new.toml"
    assert here("tournament", "init", file).returncode == 0
    for arguments in (
        ("tournament", "init", file),
        ("tournament", "run", tmp_path / "gone.toml", "--data", tmp_path),
        ("tournament", "run", file, "--venue", "mars", "--data", tmp_path),
        ("leaderboard", "--data", tmp_path),
        ("leaderboard", "--data", tmp_path, "--format", "pdf"),
    ):
        done = here(*arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.count("\n") == 1
        assert done.stderr.startswith("arena: ")
