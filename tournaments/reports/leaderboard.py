"""The leaderboard: one set of columns for the terminal, Markdown, HTML and the web page, and its rows for programs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tournaments.ratings.standings import Standing

_MEANINGS = {
    "late": "turns without an answer in time",
    "unreadable": "answers that were not one legal action per unit",
    "stale": "messages for another tick, or a second answer",
    "garbled": "messages that were none",
    "forged": "messages that somebody else sent in its name",
    "vanished": "lost connections",
    "raised": "turns on which its own code failed",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the leaderboard."""

    name: str
    """Its head, with the unit if there is one."""
    text: Callable[[Standing], str | int]
    """Returns what stands in a row."""
    key: Callable[[Standing], str | None] = lambda _: None
    """Returns what a row is sorted by, where that is not its text; empty if it is not known."""
    meaning: str = ""
    is_low_first: bool = False
    """Whether the lowest comes first when the column is first chosen to be sorted by."""


_ENTRY = Column(name="entry", text=lambda row: row.name, is_low_first=True)
STRENGTH = (
    Column(name="rank", text=lambda row: row.rank_range, key=lambda row: f"{row.rating.rank}", is_low_first=True),
    Column(name="Elo", text=lambda row: f"{row.rating.elo:+.0f}", key=lambda row: f"{row.rating.elo:.2f}"),
    Column(
        name="95% interval",
        text=lambda row: f"{row.rating.elo_low:+.0f} to {row.rating.elo_high:+.0f}",
        key=lambda row: f"{row.rating.elo_high - row.rating.elo_low:.2f}",
        meaning="Sorted by its width",
        is_low_first=True,
    ),
    Column(
        name="score",
        text=lambda row: "-" if row.record.score is None else f"{row.record.score:.3f}",
        key=lambda row: "" if row.record.score is None else None,
    ),
    Column(name="wins", text=lambda row: row.record.wins),
    Column(name="draws", text=lambda row: row.record.draws),
    Column(name="losses", text=lambda row: row.record.losses),
)
_FORFEITS = Column(
    name="forfeits",
    text=lambda row: row.forfeits,
    meaning="matches lost by not being there, or by too many missed turns",
)


def columns(rows: Sequence[Standing]) -> list[Column]:
    """Return the columns of a leaderboard; a kind of failure that nobody had takes no room."""
    rank, *others = STRENGTH
    return [rank, _ENTRY, *others, *share_columns(rows), *failure_columns(rows)[0], *latency_columns(rows)]


def share_columns(rows: Sequence[Standing]) -> list[Column]:
    """Return a column for each method of shares that was asked for."""
    return [_share_column(name) for name in (rows[0].shares if rows else ())]


def _share_column(name: str) -> Column:
    def text(row: Standing) -> str:
        share, low, high = (f"{100 * part:.0f}" for part in (row.shares[name].share, row.shares[name].low, row.shares[name].high))
        return f"{share}%, {low} to {high}"

    return Column(
        name=name,
        text=text,
        key=lambda row: f"{row.shares[name].share:.4f}",
        meaning="Its share, with the 95% interval",
    )


def failure_columns(rows: Sequence[Standing]) -> tuple[list[Column], list[Column]]:
    """Return a column for each kind of failure that somebody had, and for each that nobody had."""
    every = [_FORFEITS, *(_failure_column(kind) for kind in fault_kinds(rows))]
    counted = [column for column in every if any(column.text(row) for row in rows)]
    return counted, [column for column in every if column not in counted]


def latency_columns(rows: Iterable[Standing]) -> tuple[Column, ...]:
    """Return the columns of answer times; none where no network lay between."""
    return _LATENCY if any(row.latency for row in rows) else ()


def _failure_column(kind: str) -> Column:
    return Column(name=kind, text=lambda row: row.faults.get(kind, 0), meaning=_MEANINGS.get(kind, ""))


def _latency_column(name: str, pick: Callable[[Any], float], meaning: str) -> Column:
    return Column(
        name=name,
        text=lambda row: "-" if row.latency is None else f"{1_000 * pick(row.latency):.1f}",
        key=lambda row: "" if row.latency is None else None,
        meaning=meaning,
        is_low_first=True,
    )


_LATENCY = (
    _latency_column("p50 ms", lambda latency: latency.p50_s, "Median over matches of each match's median answer"),
    _latency_column("p99 ms", lambda latency: latency.p99_s, "The 99th percentile of the worst match"),
)


def fault_kinds(rows: Iterable[Standing]) -> list[str]:
    """Return every kind of fault that is counted, in the order of a report's columns."""
    return list(dict.fromkeys(kind for row in rows for kind in row.faults))


def as_table(rows: Sequence[Standing]) -> tuple[list[str], list[list[str | int]]]:
    """Return the heads and the rows, as `arena.console.print_table` takes them."""
    shown = columns(rows)
    return [column.name for column in shown], [[column.text(row) for column in shown] for row in rows]


def as_web_table(rows: Sequence[Standing]) -> dict[str, Any]:
    """Return the leaderboard as the web page shows and sorts it."""
    return to_web_table(rows, columns(rows))


def to_web_table(rows: Sequence[Standing], shown: Sequence[Column]) -> dict[str, Any]:
    """Return these columns of a leaderboard as the web page shows and sorts them."""
    heads = [{"name": column.name, "meaning": column.meaning, "is_low_first": column.is_low_first} for column in shown]
    return {
        "columns": heads,
        "rows": [[{"text": column.text(row), "key": column.key(row)} for column in shown] for row in rows],
    }


def row_to_dict(row: Standing) -> dict[str, Any]:
    """Return a row as JSON and CSV hold it."""
    rating, record = row.rating, row.record
    return {
        "rank": rating.rank,
        "rank_low": rating.rank_low,
        "rank_high": rating.rank_high,
        "entry": row.name,
        "elo": rounded(rating.elo, 1),
        "elo_low": rounded(rating.elo_low, 1),
        "elo_high": rounded(rating.elo_high, 1),
        "matches": record.n_matches,
        "wins": record.wins,
        "draws": record.draws,
        "losses": record.losses,
        "points": record.wins + record.draws / 2,
        "score": rounded(record.score, 4),
        "forfeits": row.forfeits,
        "faults": dict(row.faults),
        **(
            {"shares": {name: {part: rounded(value, 4) for part, value in asdict(of).items()} for name, of in row.shares.items()}}
            if row.shares
            else {}
        ),
    }


def rounded(value: Any, digits: int) -> Any:
    """Return a number with so many digits behind its point, and what is none as it is."""
    return round(value, digits) + 0.0 if isinstance(value, float) else value  # + 0.0: there is no -0.0
