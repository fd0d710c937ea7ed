"""The standings of a ladder as a table or as JSON, read from the store."""

import json

from arena.console import format_table
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.skill import rank
from tournaments.store.schema import StoreError

FORMATS = ("text", "json")
_COUNTS = ("wins", "draws", "losses", "forfeits")


def render_ladder(url: str, ladder: str, form: str) -> str:
    """Return who leads a ladder; without its name, the one on which a match was counted last.

    Raises
    ------
    StoreError
        The store holds no such ladder.
    """
    with LadderStore(url, make=False) as store:
        name = ladder or store.latest_ladder()
        rows = rank(store.entries(name))
    if not rows:
        raise StoreError(f"the store holds no ladder of a pit called {name}; arena serve --ladder --pit {name} begins one")
    if form == "json":
        return json.dumps({"ladder": name, "standings": rows}, indent=2) + "\n"
    cells = [
        (
            place,
            row["name"],
            f"{row['rating']:.1f}",
            f"{row['mu']:.1f} +- {2 * row['sigma']:.1f}",
            *(row[what] for what in _COUNTS),
        )
        for place, row in enumerate(rows, 1)
    ]
    return format_table(("rank", "name", "rating", "estimate", *_COUNTS), cells)
