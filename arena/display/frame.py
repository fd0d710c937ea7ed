"""One tick as those get it who draw it elsewhere: a web page, or another program. Plain data that JSON can hold.

Whoever has the true state makes the same frame of it as a spectator who was only sent it, so that one page draws both.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.rules import is_in_reach, is_move, reach_of, squared_distance
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team

Grid = NDArray[np.int8]
"""int8, shape (side, side), codes of Table 2."""
Units = Sequence[Sequence[tuple[int, int, bool]]]
"""Row, column and whether it lives, of each of blue's units and of each of red's."""
Events = Mapping[str, Sequence[tuple[int, int]]]
"""Units as (team, index), by what happened to them."""
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
        "kinds": kinds,
        "units": [[kind.name for kind in ruleset.team(team)] for team in Team],
    }


def describe_tick(
    tick: int,
    *,
    score: int,
    living: Sequence[int],
    truth: Grid | None,
    seen: Sequence[Grid | None],
    units: Units,
    events: Events,
    orders: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Return one tick.

    Parameters
    ----------
    score
        Blue's.
    living
        Blue's living units, and red's.
    seen
        What blue sees, and red. Here and under `truth`, None is what the teller does not know.
    units
        Of blue, and of red; a fallen unit is where it fell.
    events
        Under "fought", "fell" and "captured" the units to which the tick did that, as (team, index).
    orders
        What blue's units are told on this board, and red's, as `orders_to_text` gives it; None where it is not known.
    """
    return {
        "tick": tick,
        "score": score,
        "living": list(living),
        "truth": None if truth is None else to_text(truth),
        "seen": [None if grid is None else to_text(grid) for grid in seen],
        "units": [[[row, column, int(alive)] for row, column, alive in team] for team in units],
        "events": {name: [list(unit) for unit in those] for name, those in events.items()},
        "orders": None if orders is None else list(orders),
    }


def orders_to_text(orders: bytes) -> str:
    """Return a digit for each unit, that of the `Action` which its order comes to: whatever is no move means to stay."""
    return "".join(str(order if is_move(order) else int(Action.STAY)) for order in orders)


def find_events(ruleset: Ruleset, before: Units | None, now: Units) -> Events:
    """Return what happened to units of which only the places are known, as a spectator's are, since the tick before.

    Who fought follows from the rules and the places. A capture ends the match, and then its journal tells it.
    """
    events: dict[str, list[tuple[int, int]]] = {"fought": [], "fell": [], "captured": []}
    if before is None:
        return events
    walkers = [
        (team, index, *now[team][index], reach_of(kind.attack, ruleset.attack_at_range, kind.flies))
        for team in Team
        for index, kind in enumerate(ruleset.team(team))
        if before[team][index][2] and not kind.flies
    ]
    for team, index, row, column, lives, _ in walkers:
        enemies = [(r, c, reach) for other, _, r, c, _, reach in walkers if other != team]
        if any(is_in_reach(squared_distance(row - r, column - c), reach) for r, c, reach in enemies):
            events["fought"].append((int(team), index))
        if not lives:
            events["fell"].append((int(team), index))
    return events
