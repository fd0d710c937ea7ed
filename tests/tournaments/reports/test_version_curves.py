"""A report on every version: each is rated under its label, and an entry's versions make a curve."""

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_leagues import play
from outcomes import met

from arena.game.types import Team
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.reports.charts import curve_plots
from tournaments.reports.formats import to_markdown
from tournaments.reports.page import to_html
from tournaments.reports.report import Report, make_report, summary, to_document
from tournaments.store.store import Store, StoredLeague

Arena = Callable[..., subprocess.CompletedProcess[str]]
LABELS = ("bot", "bot.2", "bot.3", "rush", "<b>", "<b>.2")
FACTS = {"ruleset": "paper", "rules": "1", "entries": {"bot.3": "3", "rush": "1", "<b>.2": "2"}, "clock": {}, "secret": "0"}


def called(outcome: Outcome) -> Outcome:
    """Return a match of a made-up league with its entries called by `LABELS`."""
    match = LeagueMatchId.parse(outcome.identity)
    one, other = LABELS[int(match.one)], LABELS[int(match.other)]
    blue = LABELS[int(match.blue)]
    return met(one, other, match.pair, blue, outcome.result.winner, league="friday")


@pytest.fixture(scope="module")
def report() -> Report:
    outcomes = [called(one) for one in play((-400, -100, 200, 0, 150, 150), 8, np.random.default_rng(1))]
    league = StoredLeague(id=1, name="friday", hash="0", n_pairs=8, definition=FACTS)
    return make_report(league, outcomes, n_draws=200, rating_method="normal", has_all_versions=True)


def test_every_version_is_rated_and_each_entry_that_has_several_has_them_in_order(report: Report) -> None:
    document = to_document(report)

    assert {row["entry"] for row in document["standings"]} == set(LABELS)
    versions = document["versions"]
    assert {entry: [step["label"] for step in steps] for entry, steps in versions.items()} == {
        "bot": ["bot", "bot.2", "bot.3"],
        "<b>": ["<b>", "<b>.2"],
    }
    assert [step["current"] for step in versions["bot"]] == [False, False, True]
    elos = {row["entry"]: row["elo"] for row in document["standings"]}
    assert [step["elo"] for step in versions["bot"]] == [elos[name] for name in LABELS[:3]]
    assert versions["bot"][0]["better_than_before"] is None
    assert versions["bot"][2]["better_than_before"] > 0.95
    assert all(step["elo_low"] < step["elo"] < step["elo_high"] for steps in versions.values() for step in steps)


def test_text_and_markdown_say_how_an_entry_went_from_version_to_version(report: Report) -> None:
    line = next(line for line in summary(report) if line.startswith("versions of bot: 1 "))

    assert re.fullmatch(r"versions of bot: 1 -\d+, 2 -\d+ \(\d+% better\), 3 \+\d+ \(current, \d+% better\)", line)
    assert f"- {line}" in to_markdown(report).replace("\\", "")
    assert not any("versions of rush" in line for line in summary(report))


def test_the_page_draws_a_curve_for_each_and_names_stay_text(report: Report, tmp_path: Path) -> None:
    page = to_html(report, tmp_path / "a.html", tmp_path)
    section = page.partition("From version to version")[2].partition("</section>")[0]

    assert section.count("<svg") == 2
    assert section.count("<circle") == 5
    assert "<b>" not in section
    assert "bot.3: +" in section


def test_higher_on_the_curve_is_stronger_and_all_stay_on_it(report: Report) -> None:
    curves = curve_plots(report.curves)

    points = next(curve for curve in curves if curve.entry == "bot").points
    assert points[0].y > points[1].y > points[2].y
    assert [point.x for point in points] == sorted(point.x for point in points)
    for curve in curves:
        assert all(0 <= point.y_high < point.y < point.y_low <= curve.height for point in curve.points)
        assert curve.ticks == curves[0].ticks


def test_the_command_shows_versions_when_it_is_asked_to(here: Arena, tmp_path: Path) -> None:
    with Store(str(tmp_path / "arena.db")) as store:
        league = store.enter("friday", FACTS | {"entries": {"bot.2": "2", "rush": "1"}}, 1)
        for one, other in (("bot", "rush"), ("bot.2", "rush"), ("bot", "bot.2")):
            for blue in (one, other):
                store.add(league, met(one, other, 0, blue, Team.BLUE, league="friday"))
    asked = ("tournament", "report", "friday", "--data", tmp_path)

    current, every = (json.loads(here(*asked, "--json", *more).stdout) for more in ((), ("--all-versions",)))

    assert [row["entry"] for row in current["standings"]] == ["bot.2", "rush"]
    assert "versions" not in current
    assert [step["label"] for step in every["versions"]["bot"]] == ["bot", "bot.2"]
    assert "versions of bot: 1 " in here(*asked, "--all-versions").stdout
