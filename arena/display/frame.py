"""One tick as those get it who draw it elsewhere: a web page, or another program. Plain data that JSON can hold.

Whoever has the true state makes the same scene of it as a spectator who was only sent it, so that one page draws both.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.rules import reach_of
from arena.game.ruleset import Ruleset
from arena.game.types import Team

Grid = NDArray[np.int8]
"""int8, shape (side, side), codes of Table 2."""
_LETTERS = np.frombuffer(b"?012345678", np.uint8)
"""By code + 1."""


def to_text(grid: Grid) -> str:
    """Return a board as one letter a cell, row by row: the digit of its Table 2 code, `?` where it is hidden."""
    return _LETTERS[grid.ravel() + 1].tobytes().decode("ascii")


def describe_rules(ruleset: Ruleset) -> dict[str, Any]:
    """Return what of a ruleset shows on a board: its size, its clock, and what each unit of each team can do."""
    kinds = {
        kind.name: {
            "step": kind.step,
            "sight": kind.sight,
            "attack": kind.attack,
            "reach": reach_of(kind.attack, ruleset.attack_at_range, kind.flies),
            "flies": kind.flies,
        }
        for kind in ruleset.units
    }
    return {
        "name": ruleset.name,
        "side": ruleset.side,
        "tick_limit": ruleset.tick_limit,
        "fog": ruleset.fog,
        "attack_at_range": ruleset.attack_at_range,
        "kinds": kinds,
        "units": [[kind.name for kind in ruleset.team(team)] for team in Team],
    }


def describe_tick(
    tick: int,
    *,
    score: int,
    living: Sequence[int],
    truth: Grid,
    seen: Sequence[Grid],
    units: Sequence[Sequence[tuple[int, int, bool]]],
) -> dict[str, Any]:
    """Return one tick.

    Parameters
    ----------
    score
        Blue's.
    living
        Blue's living units, and red's.
    seen
        What blue sees, and red.
    units
        Row, column and whether it lives, of each of blue's units and of each of red's; a fallen one is where it fell.
    """
    return {
        "tick": tick,
        "score": score,
        "living": list(living),
        "truth": to_text(truth),
        "seen": [to_text(grid) for grid in seen],
        "units": [[[row, column, int(alive)] for row, column, alive in team] for team in units],
    }
