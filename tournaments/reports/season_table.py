"""The table of a season: what its process keeps of it in the store, and what pages make of that.

A page reads that one document, however many matches the season has.
"""

from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from tournaments.league.season import Phase
from tournaments.league.versions import entry_of, number_of
from tournaments.ratings.rate import Rating
from tournaments.ratings.standings import Record, Standing
from tournaments.reports.leaderboard import STRENGTH, Column, failure_columns, row_to_dict, to_web_table

_RANK, *_OTHERS = STRENGTH
_COLUMNS = (
    _RANK,
    Column(name="entry", text=lambda row: entry_of(row.name), is_low_first=True),
    Column(name="version", text=lambda row: number_of(row.name), meaning="of its code; its results are this version's alone"),
    *_OTHERS,
)


def describe_season(
    name: str,
    rows: Sequence[Standing],
    *,
    phase: Phase,
    deadline_s: float | None,
    new: Collection[str] = (),
    n_matches: int,
    n_waiting: int,
    n_playing: int,
    now_s: float,
) -> dict[str, Any]:
    """Return the table of a season as `SeasonStore.put_standings` keeps it.

    Parameters
    ----------
    rows
        Of the current versions, by their labels, the best first.
    deadline_s
        After which submissions are refused, in seconds since 1970; None is never.
    new
        Labels of those of which too little is known yet.
    n_matches
        That were played, those of earlier versions too.
    n_waiting
        Submissions that wait for their check.
    n_playing
        Matches that run.
    now_s
        When this is so, in seconds since 1970.
    """
    return {
        "season": name,
        "phase": phase,
        "deadline": None if deadline_s is None else _to_iso(deadline_s),
        "rows": [
            {
                **row_to_dict(row),
                "entry": entry_of(row.name),
                "version": number_of(row.name),
                "label": row.name,
                "is_new": row.name in new,
            }
            for row in rows
        ],
        "matches": n_matches,
        "waiting": n_waiting,
        "playing": n_playing,
        "made_at": now_s,
    }


def as_season_table(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the rows that `describe_season` made as the web page shows and sorts them; a newcomer's name has a `tag`."""
    standings = [_standing(row) for row in rows]
    table = to_web_table(standings, [*_COLUMNS, *failure_columns(standings)[0]])
    for row, cells in zip(rows, table["rows"], strict=True):
        if row.get("is_new"):
            cells[1]["tag"] = "new"
    return table


def as_text_table(rows: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[str | int]]]:
    """Return the heads and the rows, as `arena.console.print_table` takes them."""
    standings = [_standing(row) for row in rows]
    shown = [*_COLUMNS, *failure_columns(standings)[0]]
    return [column.name for column in shown], [[column.text(row) for column in shown] for row in standings]


def _standing(row: Mapping[str, Any]) -> Standing:
    return Standing(
        name=row["label"],
        rating=Rating(**{key: row[key] for key in ("elo", "elo_low", "elo_high", "rank", "rank_low", "rank_high")}),
        record=Record(**{key: row[key] for key in ("wins", "draws", "losses")}),
        faults=row.get("faults", {}),
        forfeits=row.get("forfeits", 0),
        latency=None,
    )


def _to_iso(at_s: float) -> str:
    return datetime.fromtimestamp(at_s, UTC).isoformat(timespec="seconds")
