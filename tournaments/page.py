"""A league's report as one HTML file: nothing is fetched for it, and names are text wherever they stand."""

import os
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import ceil, floor
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined, Template

from arena.game.types import Team
from arena.records.journal import journal_name
from tournaments.outcome import Outcome
from tournaments.report import Report, rank_range, summary

MOST_LISTED = 3_000
"""Matches that a page lists, each with a link to its journal; of more, it names the folder alone."""
_ROW_PX = 40
_STEPS = (10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """An entry on the rating plot; places are in percent of the plot's width."""

    label: str
    value: str
    low: float
    middle: float
    high: float
    y: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """The rating plot."""

    marks: list[Mark]
    ticks: list[tuple[float, str]]
    height: int


def to_html(report: Report, page: Path, journals: Path) -> str:
    """Return the page.

    Parameters
    ----------
    page
        Where the page will lie; links to journals start there.
    journals
        The folder of the league's journals.
    """
    way = os.path.relpath(journals, page.parent)
    rows = report.standings.rows
    kinds = list(rows[0].faults) if rows else []
    return _template().render(
        report=report,
        league=report.league,
        standings=report.standings,
        rows=rows,
        kinds=kinds,
        plot=_plot(report),
        lines=summary(report),
        fixtures=list(_fixtures(report, way)) if report.standings.n_matches <= MOST_LISTED else [],
        journals_url=_url(way) + "/",
        rank_range=rank_range,
        has_latency=any(row.latency for row in rows),
    )


@cache
def _template() -> Template:
    text = (files("tournaments") / "templates" / "report.html").read_text(encoding="utf-8")
    return Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True).from_string(text)


def _plot(report: Report) -> Plot:
    ratings = [row.rating for row in report.standings.rows]
    low = min((rating.elo_low for rating in ratings), default=0.0)
    high = max((rating.elo_high for rating in ratings), default=0.0)
    step = next((step for step in _STEPS if (high - low) / step <= 6), _STEPS[-1])
    first, last = step * floor(low / step), step * max(ceil(high / step), floor(low / step) + 1)

    def place(elo: float) -> float:
        return round(4 + 92 * (elo - first) / (last - first), 2)

    marks = [
        Mark(
            label=f"{rank_range(row)}. {row.name}",
            value=f"{row.rating.elo:+.0f}",
            low=place(row.rating.elo_low),
            middle=place(row.rating.elo),
            high=place(row.rating.elo_high),
            y=_ROW_PX * number,
        )
        for number, row in enumerate(report.standings.rows)
    ]
    ticks = [(place(elo), f"{elo:+d}" if elo else "0") for elo in range(first, last + 1, step)]
    return Plot(marks=marks, ticks=ticks, height=_ROW_PX * len(marks))


def _fixtures(report: Report, way: str) -> Iterator[dict[str, Any]]:
    """Yield each fixture with its matches, and where their journals lie."""
    fixtures: defaultdict[tuple[str, ...], list[Outcome]] = defaultdict(list)
    for outcome in report.outcomes:
        fixtures[tuple(sorted((outcome.blue, outcome.red)))].append(outcome)
    for (one, other), outcomes in sorted(fixtures.items()):
        record = report.standings.cross[one, other]
        yield {
            "one": one,
            "other": other,
            "record": record,
            "matches": [
                {"outcome": outcome, "says": _say(outcome), "url": f"{_url(way)}/{_url(journal_name(outcome.identity))}"}
                for outcome in outcomes
            ],
        }


def _say(outcome: Outcome) -> str:
    how = outcome.ending.name.lower().replace("_", " ")
    why = f" ({outcome.reason})" if outcome.reason else ""
    winner = outcome.blue if outcome.winner is Team.BLUE else outcome.red
    return f"{'draw' if outcome.winner is None else f'{winner} wins'} by {how}{why}, {outcome.ticks} ticks"


def _url(path: str) -> str:
    return quote(path.replace(os.sep, "/"))
