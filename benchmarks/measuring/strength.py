"""Draw how strong fighters are against how long they think, from what `arena evaluate` found.

`python -m benchmarks.measuring.strength FIGURE.svg RESULT.json ...`, where each result is what `arena evaluate FIGHTER --json`
printed: times turns of each fighter here, prints a line for each, and writes the figure.
"""

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from arena.console import say
from arena.errors import InputError
from benchmarks.measuring.figure import draw_figure
from benchmarks.measuring.turns import time_turns
from policies.heuristics.role_team import RoleTeam
from policies.networks.checkpoint import write_whole
from policies.registry import load

_TURNS, _MOST_S = 200, 20.0
_WIDTH_95 = 1.96
"""Half of a 95% interval, in standard errors."""


class Strength(NamedTuple):
    """What a fighter scores on average over its opponents, with the 95% interval."""

    fighter: str
    score: float
    low: float
    high: float


def read_strength(file: Path) -> Strength:
    """Read what a fighter scored from a result of `arena evaluate`.

    Raises
    ------
    InputError
        The file is no such result.
    """
    try:
        result = json.loads(file.read_text())
        rows = result["against"].values()
        score = sum(row["score"] for row in rows) / len(rows)
        errors = [(row["score_high"] - row["score_low"]) / 2 / _WIDTH_95 for row in rows]
        half = _WIDTH_95 * math.hypot(*errors) / len(errors)
        return Strength(str(result["fighter"]), score, score - half, score + half)
    except (OSError, ValueError, KeyError, AttributeError, TypeError, ZeroDivisionError) as error:
        raise InputError(f"{file} is not what `arena evaluate --json` prints; give files that hold that") from error


def time_fighter(fighter: str) -> float:
    """Return the median time of a fighter's turns against `role_team`, in milliseconds, where no clock runs."""
    return median(time_turns(load(fighter), RoleTeam, 1, _TURNS, _MOST_S)) / 1e6


def draw(points: Sequence[tuple[float, Strength]]) -> bytes:
    """Return a chart as SVG of scores over milliseconds a turn; the same points give the same bytes."""

    def fill(axes: Any) -> None:
        ms, strengths = zip(*sorted(points), strict=True)
        scores = [strength.score for strength in strengths]
        halves = [strength.high - strength.score for strength in strengths]
        axes.errorbar(ms, scores, yerr=halves, marker="o", capsize=3, gid="strength")
        for at, strength in zip(ms, strengths, strict=True):
            axes.annotate(strength.fighter, (at, strength.score), xytext=(5, 6), textcoords="offset points", fontsize="small")

    return draw_figure("strength", "milliseconds a turn, on one core", "mean score, 95%", fill)


def main(figure: Path, files: Sequence[Path]) -> None:
    """Time the fighters of all results, print a line for each, and draw them."""
    points = []
    for strength in map(read_strength, files):
        ms = time_fighter(strength.fighter)
        points.append((ms, strength))
        say(f"{strength.fighter}: {ms:.1f} ms a turn, {strength.score:.3f} ({strength.low:.3f} to {strength.high:.3f})")
    write_whole(figure, draw(points))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
