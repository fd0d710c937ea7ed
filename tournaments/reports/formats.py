"""A league's report as text, Markdown, CSV, JSON or HTML."""

import csv
import re
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from arena.console import format_table
from arena.console import to_json as write_json
from arena.errors import InputError
from tournaments.reports.leaderboard import as_table, fault_kinds, rounded, row_to_dict, share_columns
from tournaments.reports.opponents import Opponent, find_opponents
from tournaments.reports.report import MOST_SHOWN, Report, summary, to_document


def render(report: Report, form: str, page: Path, journals: Path) -> str:
    """Return a report in the format `text`, `html`, `md`, `csv` or `json`.

    Parameters
    ----------
    page
        Where it will lie; the links of HTML start there.
    journals
        The folder of the league's journals.
    """
    if form == "html":
        from tournaments.reports.page import to_html

        return to_html(report, page, journals)
    if form == "json":
        from arena.records.journal_folder import JournalFolder
        from tournaments.reports.map_gains import find_map_gains, map_gains_to_dict

        gains = find_map_gains(report, JournalFolder(journals))
        return to_json(report, **({"map_gains": map_gains_to_dict(gains)} if gains else {}))
    return {"text": to_text, "md": to_markdown, "csv": to_csv}[form](report)


def save(path: Path, text: str) -> None:
    """Write a report into a file, whose folder is made if need be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error


def to_json(report: Report, **more: Any) -> str:
    """Return the report as one JSON document; `more` is what was found outside the store."""
    return write_json(to_document(report) | more) + "\n"


def to_text(report: Report) -> str:
    """Return the leaderboard and its summary as plain text."""
    return format_table(*as_table(report.standings.rows)) + "\n".join(summary(report)) + "\n"


def to_markdown(report: Report) -> str:
    """Return the leaderboard, its summary, who is likely the stronger, and what the ratings do not tell, as Markdown."""
    standings = report.standings
    names = [row.name for row in standings.rows]
    lines = [f"# {_plain(report.league.name)}", "", *_table(*as_table(report.standings.rows)), ""]
    lines += [f"- {_plain(line)}" for line in summary(report)]
    if standings.n_matches and standings.superiority:
        chances = [(one, *(_percent(standings.superiority.get((one, other))) for other in names)) for one in names]
        lines += ["", "## How likely the row is stronger than the column, in percent", "", *_table(("entry", *names), chances)]
    if standings.residuals:
        lines += ["", "## Fixtures farthest from their ratings", ""]
        lines += _table(
            ("entry", "against", "score", "expected", "standard errors"),
            [
                (one.one, one.other, f"{one.score:.3f}", f"{one.expected:.3f}", f"{one.z:+.1f}")
                for one in standings.residuals[:MOST_SHOWN]
            ],
        )
    opponents = find_opponents(standings)
    if opponents:
        lines += ["", "## Best and worst opponents", ""]
        lines += _table(
            ("entry", "most points", "fewest", "most above its rating", "most below"),
            [
                (name, one.best.by_points, one.worst.by_points, *map(_by_rating, (one.most_above, one.most_below)))
                for name, one in opponents.items()
            ],
        )
    return "\n".join(lines) + "\n"


def _by_rating(opponent: Opponent | None) -> str:
    return "" if opponent is None else opponent.by_rating


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.0f}"


def _table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    marks = ["---" if column in ("entry", "against") else "---:" for column in columns]
    table = ([_plain(column) for column in columns], marks, *([_plain(str(cell)) for cell in row] for row in rows))
    return [f"| {' | '.join(cells)} |" for cells in table]


def _plain(text: str) -> str:
    """Escape what Markdown would take for more than text."""
    return re.sub(r"([\\`*_{}\[\]<>#|~&!])", r"\\\1", " ".join(text.split()))


def to_csv(report: Report) -> str:
    """Return the leaderboard as CSV: a row for each entry, an empty cell for what is not known."""
    standings = report.standings.rows
    values = [row_to_dict(row) for row in standings]
    columns = [name for name in (values[0] if values else ()) if name not in ("faults", "shares")]
    kinds = fault_kinds(standings)
    shares = [name for column in share_columns(standings) for name in (column.name, f"{column.name}_low", f"{column.name}_high")]
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow((*columns, *shares, *kinds, "latency_p50_s", "latency_p99_s"))
    for row, value in zip(standings, values, strict=True):
        latency = (None, None) if row.latency is None else (rounded(row.latency.p50_s, 6), rounded(row.latency.p99_s, 6))
        drawn = [part for of in value.get("shares", {}).values() for part in of.values()]
        table.writerow((*(value[name] for name in columns), *drawn, *(row.faults.get(kind, 0) for kind in kinds), *latency))
    return text.getvalue()
