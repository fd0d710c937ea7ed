"""The standings of a ladder as a table or as JSON, read from the store."""

import json
import time
from collections.abc import Sequence
from typing import Any

from arena.console import format_table
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.skill import SURE, age, rank
from tournaments.store.schema import StoreError

FORMATS = ("text", "json")
_COUNTS = ("wins", "draws", "losses", "forfeits")
_RATING = f"the estimate less {SURE:g} times how unsure it is, so that who has played little stands low"
_COLUMNS = {"rank": "", "entry": "", "rating": _RATING, "estimate": "with its 95% interval", **dict.fromkeys(_COUNTS, "")}
"""Their meanings."""
_LOW_FIRST = ("rank", "entry")


def read_ladder(url: str, ladder: str, now_s: float | None = None) -> tuple[str, list[dict[str, Any]]]:
    """Return a ladder's name and its standings; without its name, of the one on which a match was counted last.

    They are as sure as at `now_s`, in seconds since 1970; now without it.

    Raises
    ------
    StoreError
        The store holds no such ladder.
    """
    with LadderStore(url, make=False) as store:
        name = ladder or store.latest_ladder()
        now_s = time.time() if now_s is None else now_s
        rows = rank([age(entry, now_s) for entry in store.entries(name)])
    if not rows:
        raise StoreError(f"the store holds no ladder of a pit called {name}; arena serve --ladder --pit {name} begins one")
    return name, rows


def render_ladder(url: str, ladder: str, form: str) -> str:
    """Return who leads a ladder; raises as `read_ladder` does."""
    name, rows = read_ladder(url, ladder)
    if form == "json":
        return json.dumps({"ladder": name, "standings": rows}, indent=2) + "\n"
    return format_table(("rank", "name", "rating", "estimate", *_COUNTS), _cells(rows))


def describe_ladder(url: str, ladder: str) -> dict[str, Any]:
    """Return a ladder as the web page shows and sorts it; raises as `read_ladder` does."""
    name, rows = read_ladder(url, ladder)
    columns = [{"name": one, "meaning": meaning, "is_low_first": one in _LOW_FIRST} for one, meaning in _COLUMNS.items()]
    keys = {"rating": "rating", "estimate": "mu"}
    table = [
        [
            {"text": cell, "key": f"{row[keys[column]]}" if column in keys else None}
            for column, cell in zip(_COLUMNS, cells, strict=True)
        ]
        for row, cells in zip(rows, _cells(rows, "\u00b1"), strict=True)
    ]
    return {"ladder": name, "standings": rows, "leaderboard": {"columns": columns, "rows": table}}


def _cells(rows: Sequence[dict[str, Any]], more_or_less: str = "+-") -> list[tuple[Any, ...]]:
    return [
        (
            place,
            row["name"],
            f"{row['rating']:.1f}",
            f"{row['mu']:.1f} {more_or_less} {2 * row['sigma']:.1f}",
            *(row[what] for what in _COUNTS),
        )
        for place, row in enumerate(rows, 1)
    ]
