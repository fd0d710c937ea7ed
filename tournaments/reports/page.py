"""A league's report as one HTML file: nothing is fetched for it, and names are text wherever they stand."""

import os
from base64 import b64encode
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined, Template

from arena.errors import JournalError
from arena.records.journal import journal_name
from arena.records.journal_folder import JournalFolder
from arena.records.plan import LeagueMatchId
from clients.web.page_file import player_page
from tournaments.outcome import Outcome
from tournaments.ratings.methods import DEFAULT
from tournaments.reports.charts import chance_map, curve_plots, format_record, heat_map, rating_plot, side_plot
from tournaments.reports.leaderboard import STRENGTH, failure_columns, latency_columns, share_columns
from tournaments.reports.map_gains import FEATURES, find_map_gains
from tournaments.reports.opponents import find_opponents
from tournaments.reports.replays import pack_replays
from tournaments.reports.report import LATENCY_NOTE, MOST_SHOWN, Report, verdict_lines, warnings
from tournaments.store.store import StoredLeague

MOST_LISTED = 600
"""Matches whose lists stand in the page; those of more are written by its script, a fixture's when its cell is chosen."""


def to_html(report: Report, page: Path, journals: Path) -> str:
    """Return the page.

    Parameters
    ----------
    page
        Where the page will lie; links to journals start there.
    journals
        The folder of the league's journals.
    """
    standings = report.standings
    folder = _url(os.path.relpath(journals, page.parent)) + "/"
    failures, absent = failure_columns(standings.rows)
    fixtures = _fixtures(report.outcomes)
    is_listed = standings.n_matches <= MOST_LISTED
    kept = JournalFolder(journals)
    bundled: set[str] = set()
    with suppress(JournalError):  # a bundle that cannot be read
        bundled = kept.bundled()
    replays = pack_replays(report, kept)
    player, source = player_page() if replays else ("", "")
    gains = find_map_gains(report, kept)
    found = {} if is_listed else {pair: _letters(report.league, pair, fixtures[pair]) for pair in fixtures}
    return _template().render(
        report=report,
        default_method=DEFAULT,
        league=report.league,
        standings=standings,
        rows=standings.rows,
        strength=(*STRENGTH, *share_columns(standings.rows)),
        failures=failures,
        absent=[column.name for column in absent],
        latency=latency_columns(standings.rows),
        plot=rating_plot(standings.rows),
        curves=curve_plots(report.curves),
        side=side_plot(standings.side),
        sides=(("blue", standings.side.blue_wins), ("drawn", standings.side.draws), ("red", standings.side.red_wins)),
        heat=heat_map(standings),
        chances=chance_map(standings) if standings.n_matches and standings.superiority else {},
        residuals=standings.residuals[:MOST_SHOWN],
        opponents=find_opponents(standings),
        features=FEATURES,
        gains={entry: {one.feature: one for one in of} for entry, of in groupby(gains, key=lambda one: one.entry)},
        verdict=verdict_lines(report),
        warnings=warnings(report),
        fixtures=[_list(report, pair, fixtures[pair], folder, bundled, replays) for pair in fixtures] if is_listed else [],
        player=player,
        player_source=source,
        numbers={pair: number for number, pair in enumerate(fixtures)} if is_listed else {},
        letters={pair: text for pair, text in found.items() if text is not None},
        folder=folder,
        has_bundles=bool(bundled),
        latency_note=LATENCY_NOTE,
    )


@cache
def _template() -> Template:
    """Return the template, with its style and its script in it; no other script will run in the page."""
    here = files("tournaments") / "templates"
    page, style, script = ((here / name).read_text(encoding="utf-8") for name in ("report.html", "report.css", "report.js"))
    room = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    room.globals.update(
        style=style,
        script=script,
        script_hash=b64encode(sha256(script.encode()).digest()).decode(),
    )
    return room.from_string(page)


def _fixtures(outcomes: Iterable[Outcome]) -> Mapping[tuple[str, str], Sequence[Outcome]]:
    """Return the matches of every two entries, sorted."""
    fixtures: defaultdict[tuple[str, str], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        one, other = sorted((outcome.blue, outcome.red))
        fixtures[one, other].append(outcome)
    return dict(sorted(fixtures.items()))


def _list(
    report: Report,
    pair: tuple[str, str],
    outcomes: Sequence[Outcome],
    folder: str,
    bundled: Set[str],
    replays: Mapping[str, str],
) -> dict[str, Any]:
    """Return a fixture with its matches, their replays if there are any, and where their journals lie, unless in a bundle."""
    return {
        "pair": pair,
        "says": " v ".join(pair) + ": " + format_record(report.standings.cross[pair]),
        "matches": [
            {
                "outcome": outcome,
                "says": f"{outcome.headline}, {outcome.result.ticks} ticks",
                "url": "" if outcome.identity in bundled else folder + _url(journal_name(outcome.identity)),
                "name": journal_name(outcome.identity),
                "replay": replays.get(outcome.identity, ""),
            }
            for outcome in outcomes
        ],
    }


def _letters(league: StoredLeague, pair: tuple[str, str], outcomes: Sequence[Outcome]) -> str | None:
    """Return how the first of two entries fared in each match, a letter each; None where the script could not name the journals.

    A pair of matches has two letters, the first for the match that the first entry played as blue; `-` was not played.
    """
    one, other = pair
    names = [
        str(LeagueMatchId(league=league.name, one=one, other=other, pair=number, blue=blue))
        for number in range(league.n_pairs)
        for blue in pair
    ]
    found = {outcome.identity: _letter(outcome, one) for outcome in outcomes}
    if not found.keys() <= set(names) or any(journal_name(name) != name.replace("/", "+") + ".journal" for name in found):
        return None
    return "".join(found.get(name, "-") for name in names).rstrip("-")


def _letter(outcome: Outcome, entry: str) -> str:
    return "d" if outcome.winner is None else "w" if outcome.winner == entry else "l"


def _url(path: str) -> str:
    return quote(path.replace(os.sep, "/"))
