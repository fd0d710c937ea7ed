"""Leagues in the browser: the leaderboard is sorted, a cell leads to its replays, and a replay that does not hold says where."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import browser, says, visit
from commands import run_here

from arena.network.address import free_port
from arena.records.journal_folder import load_journal

__all__ = ["browser", "visit"]

Start = Callable[..., Any]
LEAGUE = """
pairs = 2
venue = "local"
seed = 3
[rules]
side = 10
tick_limit = 30
[entries]
rush = "rush"
patrol = "patrol"
random = "random"
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Play a league, and return where its data are."""
    folder = tmp_path_factory.mktemp("league")
    (folder / "friday.toml").write_text(LEAGUE)
    run_here("tournament", "run", folder / "friday.toml", "--data", folder)
    return folder


@pytest.fixture(scope="module")
def home(data: Path, shared_start: Start) -> str:
    """Return where the page of that league is; no pit is open."""
    web = shared_start("web", "--pit", f"tcp/127.0.0.1:{free_port()}", "--port", 0, "--data", data)
    return str(web.wait_for("web page at ").said.partition("web page at ")[2].split("/\n")[0])


@pytest.fixture
def journals(data: Path) -> Iterator[dict[Path, bytes]]:
    """Lend the league's journals to who changes them; at the end they are as they were."""
    kept = {path: path.read_bytes() for path in (data / "journals" / "friday").glob("*.journal")}
    yield kept
    for path, content in kept.items():
        path.write_bytes(content)


def test_the_leaderboard_says_what_the_report_says_and_can_be_sorted(home: str, visit: Start, arena: Start, data: Path) -> None:
    report = json.loads(arena("leaderboard", "--data", data, "--json").stdout)
    page = visit(f"{home}/league")
    says(page, "friday: 12 of 12 matches are played. Rules paper.")
    entries = page.locator("table").first.locator("tbody th")
    best_first = [row["entry"] for row in report["standings"]]

    assert entries.all_text_contents() == best_first
    texts = page.locator("table").first.locator("tbody td:nth-child(4)").all_text_contents()
    intervals = [float(number) for text in texts for number in text.replace("\u2212", "-").split(" to ")]
    assert intervals == pytest.approx([row[end] for row in report["standings"] for end in ("elo_low", "elo_high")], abs=0.51)
    page.get_by_role("button", name="Entry").click()
    assert entries.all_text_contents() == sorted(best_first)
    page.get_by_role("button", name="Entry").click()
    assert entries.all_text_contents() == sorted(best_first, reverse=True)
    assert page.locator("th[aria-sort=descending]").text_content() == "entry \u25be"
    page.get_by_role("button", name="Wins").click()
    wins = {row["entry"]: row["wins"] for row in report["standings"]}
    assert [wins[name] for name in entries.all_text_contents()] == sorted(wins.values(), reverse=True)


def test_a_cell_leads_to_its_replays_and_a_changed_journal_says_where_it_breaks(
    home: str, visit: Start, journals: dict[Path, bytes]
) -> None:
    page = visit(f"{home}/league")
    page.get_by_role("button", name="rush against random").click()
    matches = page.get_by_role("table", name="Matches").get_by_role("link", name="Replay of")
    matches.first.wait_for()
    assert matches.count() == 4
    matches.first.click()
    says(page, "Every tick was played again and holds.")
    assert page.get_by_role("alert").count() == 0
    address = page.url

    for path, content in journals.items():
        path.write_bytes(content.replace(load_journal(path).ticks[2].chain, bytes(32)))
    page.goto(address)

    says(page, "Over: ")
    banner = page.get_by_role("alert").text_content() or ""
    assert banner.startswith("This replay does not verify: it breaks at tick 3.")
    assert page.get_by_label("Tick", exact=True).get_attribute("max") == "2"


def test_a_match_that_no_league_has_is_said_and_the_leaderboard_offered(home: str, visit: Start) -> None:
    page = visit(f"{home}/match/replay?league=friday&identity=friday/../../keys")

    says(page, "league friday has no match friday/../../keys that is over")
    page.get_by_role("link", name="To the leaderboard").click()
    says(page, "12 of 12 matches")


def test_a_lobby_in_which_nothing_happens_plays_the_last_match_until_it_is_told_to_pause(home: str, visit: Start) -> None:
    page = visit(f"{home}/")
    board = page.get_by_role("img", name="The last match")
    picture = "board => board.toDataURL()"
    first = board.evaluate(picture)

    page.wait_for_function("first => document.querySelector('canvas').toDataURL() !== first", arg=first)
    page.get_by_role("button", name="Pause").click()

    still = board.evaluate(picture)
    page.get_by_role("button", name="Play").wait_for()
    assert board.evaluate(picture) == still
    page.locator(".last").get_by_role("link").click()
    says(page, "Every tick was played again and holds.")


def test_the_heading_of_a_fixture_leads_to_a_page_that_counts_from_the_other_side_as_well(home: str, visit: Start) -> None:
    page = visit(f"{home}/league")
    page.get_by_role("button", name="rush against random").click()
    page.get_by_role("link", name="rush against random", exact=True).click()
    record = page.get_by_role("table", name="Record of rush").locator("tbody tr").first.locator("td")
    record.first.wait_for()
    won, drawn, lost = record.all_text_contents()

    page.goto(f"{home}/league/head-to-head?league=friday&a=random&b=rush")
    record = page.get_by_role("table", name="Record of random").locator("tbody tr").first.locator("td")
    record.first.wait_for()
    assert record.all_text_contents() == [lost, drawn, won]
    page.goto(f"{home}/league/head-to-head?league=friday&a=random&b=nobody")
    says(page, "unknown entry 'nobody'")
