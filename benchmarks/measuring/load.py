"""Draw what a pit does under load, from what `arena bench pit --json` found.

`python -m benchmarks.measuring.load FIGURE.svg RESULT.json` draws turns a second over matches at once, beside bare Zenoh.
"""

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

from arena.errors import InputError
from benchmarks.measuring.figure import draw_figure
from policies.networks.checkpoint import write_whole

_PREFIX = "matches_"


class Load(NamedTuple):
    """Turns a second of a number of matches, as fast as can be."""

    n_matches: int
    pit: float
    bare: float


def read_loads(file: Path) -> list[Load]:
    """Read what each number of matches came to, the fewest first.

    Raises
    ------
    InputError
        The file is no such result.
    """
    try:
        results = json.loads(file.read_text())["pit"]
        rows = {int(name.removeprefix(_PREFIX)): row["as_fast_as_can_be"] for name, row in results.items() if _PREFIX in name}
        loads = [Load(n, float(row["turns_per_s"]), float(row["bare_zenoh"]["turns_per_s"])) for n, row in sorted(rows.items())]
    except (OSError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{file} is not what `arena bench pit --json` prints; give a file that holds that") from error
    if not loads:
        raise InputError(f"{file} has no number of matches; give what `arena bench pit --json` prints")
    return loads


def draw(loads: list[Load]) -> bytes:
    """Return a chart as SVG; the same loads give the same bytes."""

    def fill(axes: Any) -> None:
        matches = [one.n_matches for one in loads]
        axes.plot(matches, [one.bare for one in loads], marker="s", label="bare Zenoh", gid="bare")
        axes.plot(matches, [one.pit for one in loads], marker="o", label="the pit", gid="pit")
        axes.set_ylim(bottom=0)
        axes.legend()

    return draw_figure("load", "matches at once", "turns a second", fill)


def main(figure: Path, file: Path) -> None:
    """Draw one result."""
    write_whole(figure, draw(read_loads(file)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
