"""How many playouts a turn of a clock leaves room for, found by playing some, and how to say so."""

import math
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team

SHARE = 0.25
"""Of a turn's time that thinking may take where a match begins. Where enemies are near, it takes up to three times as long, and
the way to the pit and back, the enemy's client and whatever else this machine does need some, too.
"""
_MAJORITY = 3
"""Tries that decide whether there is room: if one did, a moment in which the machine was busy would weaken a fighter for good."""
_GROWTH = 2
"""From one number of playouts that is tried to the next."""


def fit_budget(
    think: Callable[[int], object], wanted: int, least: int, turn_s: float, *, clock: Callable[[], float] = time.monotonic
) -> int:
    """Return how many playouts a turn leaves room for.

    It takes as long as some ten turns, and where there is room for all that is wanted, as six times that.

    Parameters
    ----------
    think
        Thinks about one turn, with so many playouts.
    wanted, least
        The most playouts that are of use, and the fewest.
    turn_s
        Seconds of a turn.

    Returns
    -------
    int
        From `least` to `wanted`; 0 if there is no room for `least`.
    """
    if not 1 <= least <= wanted:
        raise ValueError(f"at least {least} and at most {wanted} playouts: a budget is one or more")
    allowed_s = SHARE * turn_s
    think(least)  # the first may compile, load and take memory
    fits, fits_s = 0, 0.0
    n = least
    while True:
        took_s = _time(think, n, allowed_s, clock)
        if took_s > allowed_s:
            break
        if n == wanted:
            return wanted
        fits, fits_s = n, took_s
        n = min(n * _GROWTH, wanted)
    if not fits:
        return 0
    return fits + math.floor((n - fits) * (allowed_s - fits_s) / (took_s - fits_s))


def _time(think: Callable[[int], object], n: int, allowed_s: float, clock: Callable[[], float]) -> float:
    """Return the median seconds of as many tries as decide, by their majority, whether there is room for so many."""
    taken: list[float] = []
    n_slow = 0
    while max(n_slow, len(taken) - n_slow) < _MAJORITY:
        began_s = clock()
        think(n)
        taken.append(clock() - began_s)
        n_slow += taken[-1] > allowed_s
    return median(taken)


def make_opening(ruleset: Ruleset, team: Team) -> Observations:
    """Return about what one seat is shown when a match begins, to think about before there is one; no enemy is in sight."""
    side, units = ruleset.side, ruleset.team(team)
    columns = np.arange(side) < side // 2
    ground = np.where(columns if team is Team.BLUE else ~columns, int(HALVES[team]), int(Code.HIDDEN))
    home = np.flatnonzero(np.tile(ground == HALVES[team], side))
    opening = Observations.blank(ruleset, team, 1)
    opening.ground[0, : side * side] = np.tile(ground, side)
    opening.ground[0, home[-1]] = FLAGS[team]
    opening.cell[0] = home[np.arange(len(units)) * len(home) // max(len(units), 1)]
    opening.alive[0] = 1
    opening.living[0] = len(units), len(ruleset.team(team.other))
    opening.seed[0] = 1
    return opening


def describe_budget(name: str, fits: int, wanted: int, least: int, turn_s: float, instead: str) -> str:
    """Return in a sentence what a clock leaves of a planner's budget; empty if it leaves all.

    Parameters
    ----------
    name, instead
        The planner, and the fighter whose orders it gives where there is no room for its least budget.
    fits
        What `fit_budget` returned for `wanted`, `least` and `turn_s`.
    """
    if fits >= wanted:
        return ""
    turns = f"{name}: turns of {turn_s:.3g} s"
    if fits >= least:
        return f"{turns} leave room for {fits:,} of its {wanted:,} playouts"
    return f"{turns} are too short for its least budget of {least:,} playouts; it plays the orders of {instead}"
