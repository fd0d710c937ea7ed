"""A league's report as Markdown and CSV, what it warns of, and what is drawn of it."""

import csv
import subprocess
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest

from arena.game.types import Ending, Team
from tournaments.charts import N_SHADES, heat_map, rating_plot, side_plot
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.report import Report, leaderboard, make_report, summary, to_csv, to_markdown, to_text
from tournaments.store import StoredLeague

Arena = Callable[..., subprocess.CompletedProcess[str]]
NAMES = ("best", "_odd_", "worst")


def outcome(one: str, other: str, pair: int, blue: str, winner: Team | None) -> Outcome:
    return Outcome(
        identity=f"friday/{one}/{other}/{pair:04}/{blue}-blue/0",
        blue=blue,
        red=other if blue == one else one,
        ending=Ending.CAPTURE if winner else Ending.TICK_LIMIT,
        winner=winner,
        score=0,
        ticks=10,
        reason="",
        seats={
            team: SeatOutcome(faults={"late": 2 * (team is Team.RED)}, latency_p50_s=0.0015, latency_p99_s=0.0205)
            for team in Team
        },
    )


def report(winners: tuple[Team | None, Team | None] = (Team.BLUE, Team.RED), *, findings: tuple[str, ...] = ()) -> Report:
    """Return a league of three in which `best` meets `_odd_` ten times, and nobody meets `worst`."""
    facts = {"ruleset": "paper", "rules": "0", "entries": dict.fromkeys(NAMES, "rush"), "secret": "0"}
    league = StoredLeague(id=1, name="friday_night", hash="0", n_pairs=5, facts=facts)
    outcomes = [
        outcome("_odd_", "best", pair, blue, winner)
        for pair in range(5)
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
    columns, rows = leaderboard(report())
    lines = [line for line in told.splitlines() if line.startswith("|")]
    assert len(lines) == len(rows) + 2
    assert all(line.replace("\\|", "").count("|") == len(columns) + 1 for line in lines)
    assert "\\_odd\\_" in told
    assert "two \\| three \\<b\\>" in told
    facts = [line for line in told.replace("\\", "").splitlines() if line.startswith("- ")]
    assert facts == [f"- {line}" for line in summary(report(findings=("two | three <b>",)))]


@pytest.mark.parametrize(
    ("winners", "said"),
    [
        ((Team.BLUE, Team.RED), []),
        ((Team.BLUE, Team.BLUE), ["warning: blue is favoured: it takes 100.0% of the points"]),
        ((Team.RED, None), ["warning: red is favoured: it takes 75.0% of the points"]),
    ],
)
def test_a_favoured_side_is_warned_of(winners: tuple[Team | None, Team | None], said: list[str]) -> None:
    lines = [line.partition(", and the 95%")[0] for line in summary(report(winners)) if line.startswith("warning")]

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


def test_the_commands_print_every_format(arena: Arena, tmp_path: Path) -> None:
    file, data = tmp_path / "friday.toml", tmp_path / "data"
    file.write_text('pairs = 1\nseed = 1\nentries = ["rush", "random"]\n[rules]\ntick_limit = 2')

    ran = arena("tournament", "run", file, "--venue", "local", "--data", data, "--format", "csv")
    told = arena("tournament", "report", file, "--data", data, "--format", "md")
    led = arena("leaderboard", "--data", data, "--format", "csv")

    assert [done.returncode for done in (ran, told, led)] == [0, 0, 0]
    assert ran.stdout == led.stdout
    assert {row["entry"] for row in csv.DictReader(StringIO(led.stdout))} == {"rush", "random"}
    assert told.stdout.startswith("# friday\n\n| rank | entry |")
