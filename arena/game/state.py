"""The memory of a batch of games: arrays with a leading batch axis, and the tables that one ruleset gives to its kernels.

Cells are numbered row * side + column. Units are numbered blue first, within a team those that walk before those that
fly. Nothing here knows a rule.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.rules import column_after, is_in_sight, is_on_board, reach_of, row_after, squared_distance
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team

WORD = 64
"""Cells in one word of a set of cells."""


class StateField(IntEnum):
    """Columns of `State.field`."""

    TICK = 0
    ENDING = 1
    WINNER = 2
    """A `Team`, or -1."""
    SCORE = 3
    """Blue's; red's is its negative."""
    BLUE_FLAG = 4
    """Cell."""
    RED_FLAG = 5
    BLUE_LIVING = 6
    RED_LIVING = 7


class Event(IntEnum):
    """Rows of `State.event`: what a tick may do to a unit."""

    FOUGHT = 0
    FELL = 1
    CAPTURED = 2


class State(NamedTuple):
    """The true state of `n` games."""

    ground: NDArray[np.int8]
    """Shape (n, stride): the code of what lies on each cell, units apart; zero past the last cell."""
    cell: NDArray[np.int16]
    """Shape (n, units): where each unit stands, or fell."""
    alive: NDArray[np.uint8]
    """Shape (n, units)."""
    field: NDArray[np.int32]
    """Shape (n, len(StateField))."""
    key: NDArray[np.uint32]
    """Shape (n, 2 purposes, 2 teams, 2): Philox keys of each team's moves, and of its fights."""

    event: NDArray[np.int32]
    """Shape (n, len(Event), units): the tick that last did it to a unit, as counted after it; -1 for none. No flags, so that a
    tick without events has nothing to clear."""


class TickEvents(NamedTuple):
    """What the last tick of each game did to its units; bool, shape (n, units)."""

    fought: NDArray[np.bool_]
    """An enemy had it in reach. It lives, or it fell."""
    fell: NDArray[np.bool_]
    captured: NDArray[np.bool_]
    """It stands on the enemy's flag, and that ended the match."""


class Rule(IntEnum):
    """Entries of `Tables.rule`."""

    SIDE = 0
    BLUE_UNITS = 1
    BLUE_WALKERS = 2
    RED_UNITS = 3
    RED_WALKERS = 4
    TICK_LIMIT = 5
    FOG = 6
    RANDOM_COMBAT = 7
    SELF_COUNTS = 8
    OBSTACLES = 9
    MIRROR = 10
    BACK_THIRD = 11


class Trait(IntEnum):
    """Columns of `Tables.unit`."""

    TYPE = 0
    STEP = 1
    REACH = 2
    """Greatest squared distance, in cells, at which it hits; -1 for none."""
    STRENGTH = 3
    FLIES = 4


class Tables(NamedTuple):
    """What the kernels know of a ruleset."""

    rule: NDArray[np.int64]
    """Shape (len(Rule),)."""
    unit: NDArray[np.int64]
    """Shape (units, len(Trait))."""
    neighbour: NDArray[np.int16]
    """Shape (actions, cells): the cell one step away, or the cell itself at the border."""
    place: NDArray[np.int64]
    """Shape (cells, 2): row and column of each cell."""
    disc: NDArray[np.uint64]
    """Shape (unit types, cells + 1, words): the cells in sight of each cell, as a set; the last is empty, for the fallen."""
    half: NDArray[np.uint64]
    """Shape (2 sides, 2 depths): the columns of the left and of the right half, and of the third of it next to the border."""


def n_words(side: int) -> int:
    """Return how many words a set of a board's cells takes."""
    return -(-side * side // WORD)


def make_state(ruleset: Ruleset, n_games: int) -> State:
    """Return zeroed memory for `n_games` games."""
    n_units = len(ruleset.team(Team.BLUE)) + len(ruleset.team(Team.RED))
    return State(
        ground=np.zeros((n_games, n_words(ruleset.side) * WORD), np.int8),
        cell=np.zeros((n_games, n_units), np.int16),
        alive=np.zeros((n_games, n_units), np.uint8),
        field=np.zeros((n_games, len(StateField)), np.int32),
        key=np.zeros((n_games, 2, 2, 2), np.uint32),
        event=np.full((n_games, len(Event), n_units), -1, np.int32),
    )


def make_tables(ruleset: Ruleset) -> Tables:
    """Return the tables of a ruleset."""
    side = ruleset.side
    teams = [ruleset.team(team) for team in Team]
    walkers = [sum(not unit.flies for unit in team) for team in teams]
    rule = np.zeros(len(Rule), np.int64)
    rule[: len(Rule)] = [
        side, len(teams[0]), walkers[0], len(teams[1]), walkers[1], ruleset.tick_limit, ruleset.fog, ruleset.random_combat,
        ruleset.self_counts, ruleset.obstacles, ruleset.mirror, ruleset.flag_in_back_third,
    ]  # fmt: skip
    units = [*teams[0], *teams[1]]
    traits = np.zeros((len(units), len(Trait)), np.int64)
    for row, unit in zip(traits, units, strict=True):
        reach = reach_of(unit.attack, ruleset.attack_at_range, unit.flies)
        row[:] = ruleset.units.index(unit), unit.step, reach, unit.strength, unit.flies
    rows, columns = np.divmod(np.arange(side * side), side)
    neighbour = np.zeros((len(Action), side * side), np.int16)
    for action in Action:
        to_rows, to_columns = row_after(rows, action), column_after(columns, action)
        there = is_on_board(to_rows, to_columns, side)
        neighbour[action] = np.where(there, to_rows, rows) * side + np.where(there, to_columns, columns)
    return Tables(
        rule=rule,
        unit=traits,
        neighbour=neighbour,
        place=np.stack([rows, columns], axis=1).astype(np.int64),
        disc=_discs(ruleset, rows, columns),
        half=_halves(side),
    )


def _discs(ruleset: Ruleset, rows: NDArray[Any], columns: NDArray[Any]) -> NDArray[np.uint64]:
    """Return the set of cells at a Euclidean distance of at most `sight`, for each unit type and cell."""
    cells = len(rows)
    words = n_words(ruleset.side)
    disc = np.zeros((len(ruleset.units), cells + 1, words), np.uint64)
    squared = squared_distance(rows[:, None] - rows[None, :], columns[:, None] - columns[None, :])
    bits = np.zeros((cells, words * WORD), np.uint8)
    for kind, unit in enumerate(ruleset.units):
        bits[:, :cells] = is_in_sight(squared, unit.sight)
        disc[kind, :cells] = np.packbits(bits, axis=1, bitorder="little").view(np.uint64)
    return disc


def _halves(side: int) -> NDArray[np.uint64]:
    """Return the columns of each half, and of its back third, as bits of a row."""
    half, third = side // 2, max(1, side // 6)

    def span(first: int, last: int) -> int:
        return sum(1 << column for column in range(first, last))

    return np.array([[span(0, half), span(0, third)], [span(half, side), span(side - third, side)]], np.uint64)
