"""A league's report: its facts as one JSON document, its leaderboard as text, Markdown and CSV; `tournaments.page` makes HTML.

The same results give the same document to the byte, however often the league was stopped on its way: what a clock measured, and
when the report was written, stands under the one key `wall`.
"""

import csv
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from io import StringIO
from typing import Any

from arena.console import format_table
from tournaments.outcome import Outcome
from tournaments.ratings import N_DRAWS
from tournaments.schedule import count_matches
from tournaments.standings import Standing, Standings, stand
from tournaments.store import StoredLeague

FORMAT = 1
"""Of the JSON document; rises whenever a key changes its meaning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Everything that a report tells."""

    league: StoredLeague
    standings: Standings
    outcomes: tuple[Outcome, ...]
    n_planned: int
    secret: bytes | None
    """The league's, once its last match is over."""
    written_at: datetime
    findings: tuple[str, ...] = ()
    """Sentences on what a reader should beware of, beside those that `warnings` finds itself."""

    @property
    def is_complete(self) -> bool:
        """Whether every match was played."""
        return self.standings.n_matches >= self.n_planned


def make_report(
    league: StoredLeague,
    outcomes: Iterable[Outcome],
    secret: bytes | None = None,
    *,
    n_draws: int = N_DRAWS,
    findings: Iterable[str] = (),
) -> Report:
    """Return the report of a league; its secret is told only if every match was played."""
    outcomes = tuple(outcomes)
    names = list(league.facts["entries"])
    n_planned = count_matches(len(names), league.n_pairs, is_gauntlet="hero" in league.facts)
    return Report(
        league=league,
        standings=stand(names, outcomes, n_draws=n_draws),
        outcomes=outcomes,
        n_planned=n_planned,
        secret=secret if len(outcomes) >= n_planned else None,
        written_at=datetime.now(UTC),
        findings=tuple(findings),
    )


def to_facts(report: Report) -> dict[str, Any]:
    """Return the report as what JSON can hold; numbers are rounded to what they can mean."""
    league, standings = report.league, report.standings
    return {
        "format": FORMAT,
        "league": {
            "name": league.name,
            "hash": league.hash,
            **league.facts,
            "secret": None if report.secret is None else report.secret.hex(),
            "secret_commitment": league.facts.get("secret"),
            "pairs": league.n_pairs,
        },
        "matches": {
            "played": standings.n_matches,
            "planned": report.n_planned,
            "complete": report.is_complete,
            "ticks": standings.n_ticks,
            "endings": dict(standings.endings),
        },
        "standings": [_row(row) for row in standings.rows],
        "cross": {
            row.name: {
                other.name: asdict(record) | {"score": _round(record.score, 4)}
                for other in standings.rows
                if (record := standings.cross.get((row.name, other.name))) is not None
            }
            for row in standings.rows
        },
        "side": {name: _round(value, 4) for name, value in asdict(standings.side).items()}
        | {"significant": standings.side.is_significant},
        "draw_rate": _round(standings.draw_rate, 4),
        "wall": {
            "written_at": report.written_at.isoformat(timespec="seconds"),
            "latency": {row.name: None if row.latency is None else asdict(row.latency) for row in standings.rows},
        },
    }


def _row(row: Standing) -> dict[str, Any]:
    rating, record = row.rating, row.record
    return {
        "rank": rating.rank,
        "rank_low": rating.rank_low,
        "rank_high": rating.rank_high,
        "entry": row.name,
        "elo": _round(rating.elo, 1),
        "elo_low": _round(rating.elo_low, 1),
        "elo_high": _round(rating.elo_high, 1),
        "matches": record.n_matches,
        "wins": record.wins,
        "draws": record.draws,
        "losses": record.losses,
        "points": record.wins + record.draws / 2,
        "score": _round(record.score, 4),
        "forfeits": row.forfeits,
        "faults": dict(row.faults),
    }


def _round(value: Any, digits: int) -> Any:
    return round(value, digits) + 0.0 if isinstance(value, float) else value  # + 0.0: there is no -0.0


def to_json(report: Report) -> str:
    """Return the report as one JSON document."""
    return json.dumps(to_facts(report), indent=2, ensure_ascii=False) + "\n"


def leaderboard(report: Report) -> tuple[Sequence[str], list[Sequence[object]]]:
    """Return the columns and rows of the leaderboard; a kind of failure that nobody had takes no room."""
    rows = report.standings.rows
    kinds = [kind for kind in fault_kinds(rows) if any(row.faults.get(kind) for row in rows)]
    forfeits = ["forfeits"] if any(row.forfeits for row in rows) else []
    latency = ["p50 ms", "p99 ms"] if any(row.latency for row in rows) else []
    columns = ("rank", "entry", "Elo", "95% interval", "score", "wins", "draws", "losses", *forfeits, *kinds, *latency)
    return columns, [
        (
            rank_range(row),
            row.name,
            f"{row.rating.elo:+.0f}",
            f"{row.rating.elo_low:+.0f} to {row.rating.elo_high:+.0f}",
            "-" if row.record.score is None else f"{row.record.score:.3f}",
            row.record.wins,
            row.record.draws,
            row.record.losses,
            *([row.forfeits] if forfeits else []),
            *(row.faults.get(kind, 0) for kind in kinds),
            *(_milliseconds(row) if latency else []),
        )
        for row in rows
    ]


def fault_kinds(rows: Iterable[Standing]) -> list[str]:
    """Return every kind of failure that is counted, in the order of a report's columns."""
    return list(dict.fromkeys(kind for row in rows for kind in row.faults))


def rank_range(row: Standing) -> str:
    """Return a rank as what is known of it, as in `2 to 4`."""
    low, high = row.rating.rank_low, row.rating.rank_high
    return f"{low}" if low == high else f"{low} to {high}"


def _milliseconds(row: Standing) -> tuple[str, str]:
    if row.latency is None:
        return "-", "-"
    return f"{1_000 * row.latency.p50_s:.1f}", f"{1_000 * row.latency.p99_s:.1f}"


def warnings(report: Report) -> list[str]:
    """Return what a reader should beware of, a sentence each."""
    side = report.standings.side
    favoured = "blue" if side.bias > 0 else "red"
    share = 100 * (1 + abs(side.bias)) / 2
    unfair = f"{favoured} is favoured: it takes {share:.1f}% of the points, and the 95% interval of its lead excludes 0"
    return [*([unfair] if side.is_significant else []), *report.findings]


def summary(report: Report) -> list[str]:
    """Return what stands under the leaderboard, a line each."""
    league, standings = report.league, report.standings
    side = standings.side
    endings = ", ".join(f"{n:,} by {name.replace('_', ' ')}" for name, n in standings.endings.items())
    played = f"{standings.n_matches:,} of {report.n_planned:,}" if not report.is_complete else f"{standings.n_matches:,}"
    lines = [f"league {league.name}: {played} matches{f' ({endings})' if endings else ''}; rules {league.facts['ruleset']}"]
    if standings.n_matches:
        verdict = "a side is favoured" if side.is_significant else "no side is shown to be favoured"
        lines.append(
            f"blue won {side.blue_wins:,}, red won {side.red_wins:,}; blue's points less red's {side.bias:+.3f} a match "
            f"({side.bias_low:+.3f} to {side.bias_high:+.3f}): {verdict}"
        )
        lines.append(
            f"drawn {side.draws:,} ({side.draws / standings.n_matches:.1%}); "
            f"two of equal strength would draw {standings.draw_rate:.1%} of their matches"
        )
    lines += [f"warning: {sentence}" for sentence in warnings(report)]
    if not report.is_complete:
        lines.append("the league is not over: arena tournament run goes on with it")
    return lines


def to_text(report: Report) -> str:
    """Return the leaderboard and its summary as plain text."""
    return format_table(*leaderboard(report)) + "\n".join(summary(report)) + "\n"


def to_markdown(report: Report) -> str:
    """Return the leaderboard and its summary as Markdown."""
    columns, rows = leaderboard(report)
    marks = ("---" if column == "entry" else "---:" for column in columns)
    table = (columns, marks, *([_plain(str(cell)) for cell in row] for row in rows))
    lines = [f"# {_plain(report.league.name)}", "", *(f"| {' | '.join(cells)} |" for cells in table), ""]
    return "\n".join((*lines, *(f"- {_plain(line)}" for line in summary(report)))) + "\n"


def _plain(text: str) -> str:
    """Escape what Markdown would take for more than text."""
    return re.sub(r"([\\`*_{}\[\]<>#|~&!])", r"\\\1", " ".join(text.split()))


def to_csv(report: Report) -> str:
    """Return the leaderboard as CSV: a row for each entry, an empty cell for what is not known."""
    standings = report.standings.rows
    facts = [_row(row) for row in standings]
    columns = [name for name in (facts[0] if facts else ()) if name != "faults"]
    kinds = fault_kinds(standings)
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow((*columns, *kinds, "latency_p50_s", "latency_p99_s"))
    for row, fact in zip(standings, facts, strict=True):
        latency = (None, None) if row.latency is None else (_round(row.latency.p50_s, 6), _round(row.latency.p99_s, 6))
        table.writerow((*(fact[name] for name in columns), *(row.faults.get(kind, 0) for kind in kinds), *latency))
    return text.getvalue()
