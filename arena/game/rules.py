"""The rules of a tick, each stated once, as functions of plain numbers. Everybody who needs one asks it here.

They run as they stand; `arena.game.compiled` holds the same functions for kernels. `docs/reference/rules.md` says the same in
words. None calls another, so that each can be compiled alone; those of cells and units also take numpy arrays.
"""

from typing import Any

from arena.game.types import Action, Code, Termination

HOME_BONUS = 1
"""Strength that the half a unit stands on adds to its owner's side of a fight."""
FLAG_SCORE, UNIT_SCORE = 100, 10
"""Paper, Eq. 4 and the text under it."""
_NORTH, _EAST, _SOUTH, _WEST = (int(action) for action in tuple(Action)[1:])
_OBSTACLE, _FLAG = int(Code.OBSTACLE), int(Code.BLUE_FLAG)
_RUNNING, _CAPTURE, _ELIMINATION, _TICK_LIMIT = (int(ending) for ending in tuple(Termination)[:4])


# 1. Move


def is_move(order: int) -> bool:
    """Whether an order moves a unit; any other number means to stay."""
    return _NORTH <= order <= _WEST


def row_after(row: Any, action: int) -> Any:
    """Return the row that one step leads to, on the board or off it."""
    return row + (action == _SOUTH) - (action == _NORTH)


def column_after(column: Any, action: int) -> Any:
    """Return the column that one step leads to, on the board or off it."""
    return column + (action == _EAST) - (action == _WEST)


def is_on_board(row: Any, column: Any, side: int) -> Any:
    """Whether a board has such a cell."""
    return (row >= 0) & (row < side) & (column >= 0) & (column < side)


def can_enter(code: Any, flies: Any) -> Any:
    """Whether a unit may go to a cell that shows `code`, as far as the ground is concerned; what is hidden may be free."""
    return (code != _OBSTACLE) | (flies != 0)


def wins_cell(word: int, unit: int, other_word: int, other: int) -> bool:
    """Whether of two units that claim one cell the first gets it: the larger random word, of equal ones the lower index."""
    return word > other_word or (word == other_word and unit < other)


# 2. Fight


def squared_distance(down: Any, right: Any) -> Any:
    """Return the square of a Euclidean distance, in cells."""
    return down * down + right * right


def reach_of(attack: int, at_range: bool, flies: bool) -> int:
    """Return the greatest squared distance at which a unit hits; -1 if it hits nobody."""
    return -1 if flies or attack == 0 else attack * attack - (not at_range)


def is_in_reach(squared: Any, reach: Any) -> Any:
    """Whether a unit that walks can be hit at a squared distance: that alone makes it fight."""
    return squared <= reach


def is_home(code: Any, team: int) -> Any:
    """Whether a cell that shows `code` lies on a team's own half."""
    return (code == team) | (code == _FLAG + team)


def home_bonus(is_home: Any) -> Any:
    """Return what the ground adds to the force of a unit, and `home_bonus(not is_home)` to that against it."""
    return HOME_BONUS * is_home


def own_strength(strength: Any, self_counts: Any) -> Any:
    """Return what a unit adds to its own fight."""
    return strength * self_counts


def survives(word: int, force: int, against: int) -> bool:
    """Whether a unit outlives its fight, by a random word of 32 bits: in integers, so that it is the same everywhere."""
    return (word * (force + against)) >> 32 < force


def odds(force: Any, against: Any) -> Any:
    """Return the chance that `force` beats what stands against it: what `survives` comes to over all words."""
    return force / (force + against)


def survives_without_chance(is_home: Any) -> Any:
    """Whether a unit outlives its fight where combat is not random."""
    return is_home


# 3. Judge


def is_captured(cell: int, flag: int, alive: int) -> bool:
    """Whether a unit that walks captures the enemy's flag."""
    return (cell == flag) & (alive != 0)


def is_eliminated(n_walkers: int, n_fallen: int) -> bool:
    """Whether a team that began with units that walk has none left; those that fly cannot fall."""
    return 0 < n_walkers == n_fallen


def ending_of(captures: bool, eliminations: bool, tick: int, tick_limit: int) -> int:
    """Return the `Termination` after a tick: of a capture or an elimination by either team, of the clock, or of nothing."""
    if captures:
        return _CAPTURE
    if eliminations:
        return _ELIMINATION
    return _TICK_LIMIT if tick >= tick_limit else _RUNNING


def score_of(ending: int, achieved: int, enemies_fallen: int, own_fallen: int) -> int:
    """Return a team's score; the enemy's is its negative.

    Parameters
    ----------
    achieved
        1 if this team alone captured or eliminated, as `ending` says; -1 if the enemy alone did; 0 if both did.
    """
    if ending in (_CAPTURE, _ELIMINATION):
        return FLAG_SCORE * achieved
    return min(max(UNIT_SCORE * (enemies_fallen - own_fallen), -FLAG_SCORE), FLAG_SCORE)


def winner_of(score: int) -> int:
    """Return the `Team` that has won a match by blue's score, or -1 for a draw."""
    return 0 if score > 0 else 1 if score < 0 else -1


# See


def is_in_sight(squared: Any, sight: int) -> Any:
    """Whether a unit sees a cell at a squared distance; nothing blocks sight."""
    return squared <= sight * sight
