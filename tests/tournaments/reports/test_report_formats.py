"""A league's report as Markdown and CSV, what it warns of, and what is drawn of it."""

import csv
import random
import subprocess
from collections.abc import Callable
from dataclasses import replace
from html import escape, unescape
from io import StringIO
from itertools import combinations
from pathlib import Path

import pytest
from outcomes import changed, met

from arena.game.types import Team, Termination
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.reports.charts import N_SHADES, heat_map, rating_plot, side_plot
from tournaments.reports.formats import to_csv, to_markdown, to_text
from tournaments.reports.leaderboard import as_table, as_web_table, columns
from tournaments.reports.page import to_html
from tournaments.reports.report import MOST_SHOWN, Report, make_report, summary, to_document
from tournaments.store.store import StoredLeague

Arena = Callable[..., subprocess.CompletedProcess[str]]
NAMES = ("best", "_odd_", "worst")


def outcome(one: str, other: str, pair: int, blue: str, winner: Team | None) -> Outcome:
    ending = Termination.CAPTURE if winner else Termination.TICK_LIMIT
    seats = {
        team: SeatOutcome(faults={"late": 2 * (team is Team.RED)}, latency_p50_s=0.0015, latency_p99_s=0.0205) for team in Team
    }
    return met(one, other, pair, blue, winner, league="friday", seats=seats, ending=ending)


def report(
    winners: tuple[Team | None, Team | None] = (Team.BLUE, Team.RED), *, n_pairs: int = 5, findings: tuple[str, ...] = ()
) -> Report:
    """Return a league of three in which `best` meets `_odd_` twice for each pair, and nobody meets `worst`."""
    facts = {"ruleset": "paper", "rules": "0", "entries": dict.fromkeys(NAMES, "rush"), "secret": "0"}
    league = StoredLeague(id=1, name="friday_night", hash="0", n_pairs=n_pairs, definition=facts)
    outcomes = [
        outcome("_odd_", "best", pair, blue, winner)
        for pair in range(n_pairs)
        for blue, winner in zip(("best", "_odd_"), winners, strict=True)
    ]
    return make_report(league, outcomes, n_draws=20, findings=findings)


def test_csv_has_a_row_for_each_entry_and_leaves_empty_what_is_not_known() -> None:
    rows = list(csv.DictReader(StringIO(to_csv(report()))))

    assert {row["entry"] for row in rows} == set(NAMES)
    assert rows[0]["entry"] == "best"
    best = {"rank": "1", "matches": "10", "wins": "10", "losses": "0", "points": "10.0", "late": "10", "latency_p50_s": "0.0015"}
    assert {name: rows[0][name] for name in best} == best
    assert float(rows[0]["elo_low"]) <= float(rows[0]["elo"]) <= float(rows[0]["elo_high"])
    unknown = next(row for row in rows if row["entry"] == "worst")
    assert (unknown["score"], unknown["latency_p99_s"], unknown["matches"]) == ("", "", "0")


def test_markdown_tells_what_the_text_tells_and_names_stay_text() -> None:
    told = to_markdown(report(findings=("two | three <b>",)))

    assert told.startswith("# friday\\_night\n\n| rank |")
    heads, rows = as_table(report().standings.rows)
    lines = [line for line in told.partition("## ")[0].splitlines() if line.startswith("|")]
    assert len(lines) == len(rows) + 2
    assert all(line.replace("\\|", "").count("|") == len(heads) + 1 for line in lines)
    assert "\\_odd\\_" in told
    assert "two \\| three \\<b\\>" in told
    facts = [line for line in told.replace("\\", "").splitlines() if line.startswith("- ")]
    assert facts == [f"- {line}" for line in summary(report(findings=("two | three <b>",)))]


def test_every_form_for_people_has_the_same_heads_and_cells(tmp_path: Path) -> None:
    told = report()
    heads, rows = as_table(told.standings.rows)
    web = as_web_table(told.standings.rows)
    page = to_html(told, tmp_path / "a.html", tmp_path)

    assert [column["name"] for column in web["columns"]] == heads == [column.name for column in columns(told.standings.rows)]
    assert [[cell["text"] for cell in row] for row in web["rows"]] == rows
    assert to_text(told).split("\n")[1].split() == " ".join(heads).split()
    assert f"| {' | '.join(heads)} |" in to_markdown(told)
    for head in heads:
        assert f"<button>{head}</button></th>" in page
    for row in rows:
        assert all(f">{escape(str(cell))}</t" in page for cell in row)


@pytest.mark.parametrize(
    ("winners", "n_pairs", "said"),
    [
        ((Team.BLUE, Team.RED), 5, []),
        ((Team.BLUE, Team.BLUE), 5, ["warning: blue is favoured: it takes 100.0% of the points"]),
        ((Team.RED, None), 5, []),
        ((Team.RED, None), 20, ["warning: red is favoured: it takes 75.0% of the points"]),
    ],
)
def test_a_favoured_side_is_warned_of(winners: tuple[Team | None, Team | None], n_pairs: int, said: list[str]) -> None:
    lines = [
        line.partition(", and the 95%")[0] for line in summary(report(winners, n_pairs=n_pairs)) if line.startswith("warning")
    ]

    assert lines == said


def test_findings_are_told_and_so_are_draws() -> None:
    told = to_text(report((None, Team.BLUE), findings=("three beat each other in a circle",)))

    assert "warning: three beat each other in a circle" in told
    assert "drawn 5 (50.0%); two of equal strength would draw " in told


def test_the_heat_map_shades_a_score_and_its_mirror_alike() -> None:
    table = report((Team.BLUE, None)).standings
    names = [row.name for row in table.rows]
    cells = heat_map(table)
    best, odd = cells["best"][names.index("_odd_")], cells["_odd_"][names.index("best")]

    assert best is not None
    assert odd is not None
    assert (best.text, odd.text) == ("75", "25")
    assert best.shade + odd.shade == N_SHADES - 1
    assert best.pair == odd.pair == ("_odd_", "best")
    assert best.is_upper is not odd.is_upper
    assert best.says == "best v _odd_: 5 won, 5 drawn"
    assert cells["best"][names.index("worst")] is None


def test_plots_hold_what_they_show() -> None:
    table = report((Team.BLUE, None)).standings
    ratings, side = rating_plot(table.rows), side_plot(table.side)

    assert [mark.label for mark in ratings.marks] == [row.name for row in table.rows]
    for plot in (ratings, side):
        assert all(0 <= mark.low <= mark.middle <= mark.high <= 100 for mark in plot.marks)
        assert "0" in [label for _, label in plot.ticks]


@pytest.mark.usefixtures("one_core")
def test_the_commands_print_every_format(here: Arena, tmp_path: Path) -> None:
    file, data = tmp_path / "friday.toml", tmp_path / "data"
    file.write_text('pairs = 1\nseed = 1\nentries = ["rush", "random"]\n[rules]\ntick_limit = 2')

    ran = here("tournament", "run", file, "--venue", "local", "--data", data, "--format", "csv")
    told = here("tournament", "report", file, "--data", data, "--format", "md")
    led = here("leaderboard", "--data", data, "--format", "csv")

    assert [done.returncode for done in (ran, told, led)] == [0, 0, 0]
    assert ran.stdout == led.stdout
    assert {row["entry"] for row in csv.DictReader(StringIO(led.stdout))} == {"rush", "random"}
    assert told.stdout.startswith("# friday\n\n| rank | entry |")


def league_of(names: str, n_pairs: int, lead: Callable[[str, str], float]) -> Report:
    """Return a league in which blue wins with the chance `lead(blue, red)`."""
    rng = random.Random(1)
    outcomes = [
        changed(outcome(one, other, pair, blue, None), winner=Team.BLUE if rng.random() < lead(*seats) else Team.RED)
        for one, other in combinations(names, 2)
        for pair in range(n_pairs)
        for blue, seats in ((one, (one, other)), (other, (other, one)))
    ]
    facts = {"ruleset": "paper", "rules": "0", "entries": dict.fromkeys(names, "rush"), "secret": "0"}
    return make_report(StoredLeague(id=1, name="l", hash="0", n_pairs=n_pairs, definition=facts), outcomes, n_draws=50)


def in_a_circle(blue: str, red: str) -> float:
    return 0.9 if f"{blue}{red}" in ("ab", "bc", "ca") else 0.1 if f"{red}{blue}" in ("ab", "bc", "ca") else 0.5


def test_a_circle_and_what_no_rating_expects_are_told_everywhere(tmp_path: Path) -> None:
    told = league_of("abcd", 60, in_a_circle)
    facts = to_document(told)
    [circle] = facts["cycles"]
    says = told.standings.cycles[0].sentence

    assert circle["entries"] == ["a", "b", "c"]
    assert all(score > 0.7 for score in circle["scores"])
    assert len(facts["residuals"]) == 6
    assert sum(residual["is_significant"] for residual in facts["residuals"]) == 3
    for text in (to_text(told), to_markdown(told).replace("\\", ""), unescape(to_html(told, tmp_path / "a.html", tmp_path))):
        assert says in text
        assert told.standings.residuals[0].sentence in text


def test_a_league_by_strength_has_nothing_to_beware_of() -> None:
    told = league_of("abcd", 30, lambda blue, red: 1 / (1 + 2 ** (ord(blue) - ord(red))))

    assert to_document(told)["cycles"] == []
    assert "warning" not in to_text(told)


def test_who_is_likely_the_stronger_is_told_in_every_format(tmp_path: Path) -> None:
    told = league_of("abcd", 30, lambda blue, red: 1 / (1 + 2 ** (ord(blue) - ord(red))))
    facts = to_document(told)["superiority"]
    page = to_html(told, tmp_path / "a.html", tmp_path)

    assert facts["a"].keys() == set("bcd")
    assert all(facts[one][other] == pytest.approx(1 - facts[other][one]) for one, other in combinations("abcd", 2))
    assert facts["a"]["d"] > 0.99
    best, next_best = (row.name for row in told.standings.rows[:2])
    percent = f"{100 * facts[best][next_best]:.0f}"
    assert f"| {best} |  | {percent} |" in to_markdown(told)
    assert f">{percent}</td>" in page.partition("Who is the stronger")[2]


def test_many_warnings_are_cut_short_and_the_rest_is_counted() -> None:
    told = league_of("abcd", 60, in_a_circle)
    many = replace(told, standings=replace(told.standings, cycles=told.standings.cycles * (MOST_SHOWN + 2)))

    assert "2 more circles are in the JSON document" in to_text(many)
    assert to_text(many).count("no rating shows that") == MOST_SHOWN


def test_where_maps_are_fresh_the_intervals_are_over_matches() -> None:
    """Each pair is split here: to draw pairs draws splits again, to draw matches may draw one side's wins alone."""

    def width(maps: str) -> float:
        outcomes = [
            outcome("a", "b", pair, blue, Team.RED if pair % 2 else Team.BLUE)  # whoever it is, it has this side once
            for pair in range(20)
            for blue in "ab"
        ]
        facts = {"ruleset": "paper", "rules": "0", "entries": {"a": "rush", "b": "rush"}, "secret": "0", "maps": maps}
        league = StoredLeague(id=1, name="l", hash="0", n_pairs=20, definition=facts)
        rating = make_report(league, outcomes, n_draws=200).standings.rows[0].rating
        return rating.elo_high - rating.elo_low

    assert width("fresh") > 4 * width("paired")
