"""How one field of an observation is laid out: its shape, its values, who writes it and who may read it.

The table itself is `arena.game.observation.Observations`, a row for each field.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team

Size = Callable[[Ruleset, Team], int]
"""A number that the ruleset and the observing team decide."""
Values = Sequence[int]
"""What a field can hold in a game, in ascending order."""
GROUND_CODES = tuple(sorted(map(int, (Code.HIDDEN, *HALVES, *FLAGS, Code.OBSTACLE))))


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldSpec:
    """One row of the table; the dtype is that of the field's annotation."""

    axes: tuple[int | Size, ...] = ()
    """Lengths of the axes after the leading one of seats."""
    values: Values | Callable[[Ruleset, Team], Values] | None = None
    """None is all that the dtype has."""
    blank: int = 0
    """Fills the field before anything was observed."""
    is_on_wire: bool = True
    """Fields go on the wire in the order of the table, the wider before the narrower, so that each is aligned."""
    is_of_kernel: bool = False
    """Written by the kernel at every tick; others are views of the state, or the venue's."""
    is_public: bool = False
    """A public fact of the match, which every environment shows."""
    dtype: Any = None

    def shape_of(self, ruleset: Ruleset, team: Team) -> tuple[int, ...]:
        """Return the shape for one seat."""
        return tuple(axis if isinstance(axis, int) else axis(ruleset, team) for axis in self.axes)

    def values_of(self, ruleset: Ruleset, team: Team) -> Values | None:
        """Return what it can hold in a game; None is all that the dtype has."""
        return self.values(ruleset, team) if callable(self.values) else self.values


def n_own(ruleset: Ruleset, team: Team) -> int:
    """Return how many units the team began with."""
    return len(ruleset.team(team))


def n_enemies(ruleset: Ruleset, team: Team) -> int:
    """Return how many units the other team began with."""
    return len(ruleset.team(team.other))


def n_cells(ruleset: Ruleset, team: Team) -> int:
    """Return how many cells the board has."""
    return ruleset.side**2


def ticks(ruleset: Ruleset, team: Team) -> range:
    """Return all ticks of a match."""
    return range(ruleset.tick_limit + 1)


def counts(ruleset: Ruleset, team: Team) -> range:
    """Return how many units a team may have."""
    return range(max(n_own(ruleset, team), n_enemies(ruleset, team)) + 1)


def cells(ruleset: Ruleset, team: Team) -> range:
    """Return all cells of the board."""
    return range(ruleset.side**2)


def cells_or_none(ruleset: Ruleset, team: Team) -> range:
    """Return all cells, and -1 for none."""
    return range(-1, ruleset.side**2)


def types_or_none(ruleset: Ruleset, team: Team) -> range:
    """Return all indices of unit types, and -1 for none."""
    return range(-1, len(ruleset.units))
