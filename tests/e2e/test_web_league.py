"""Leagues in the browser: the leaderboard is sorted, a cell leads to its replays, and a replay that does not hold says where."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from chromium import browser, says, visit

from arena.records.journal import load_journal

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


@pytest.fixture
def home(start: Start, arena: Start, tmp_path: Path, port: int) -> str:
    """Play a league, and return where its page is; no pit is open."""
    league = tmp_path / "friday.toml"
    league.write_text(LEAGUE)
    assert arena("tournament", "run", league, "--data", tmp_path).returncode == 0
    web = start("web", "--pit", f"tcp/127.0.0.1:{port}", "--port", 0, "--data", tmp_path)
    return web.wait_for("web page at ").said.partition("web page at ")[2].split("/\n")[0]


def test_the_leaderboard_says_what_the_report_says_and_can_be_sorted(
    home: str, visit: Start, arena: Start, tmp_path: Path
) -> None:
    report = json.loads(arena("leaderboard", "--data", tmp_path, "--json").stdout)
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
    assert page.locator("th[aria-sort=descending]").text_content() == "Entry \u25be"
    page.get_by_role("button", name="Wins").click()
    wins = {row["entry"]: row["wins"] for row in report["standings"]}
    assert [wins[name] for name in entries.all_text_contents()] == sorted(wins.values(), reverse=True)


def test_a_cell_leads_to_its_replays_and_a_changed_journal_says_where_it_breaks(home: str, visit: Start, tmp_path: Path) -> None:
    page = visit(f"{home}/league")
    page.get_by_role("button", name="rush against random").click()
    assert page.locator("#fixture li").count() == 4
    page.locator("#fixture li").first.get_by_role("link", name="Replay").click()
    says(page, "Every tick was played again and holds.")
    assert page.get_by_role("alert").count() == 0
    address = page.url

    for path in (tmp_path / "journals" / "friday").glob("*.journal"):
        journal, data = load_journal(path), path.read_bytes()
        path.write_bytes(data.replace(journal.ticks[2].chain, bytes(32)))
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
