"""What a screen shows a person who commands a seat: plain data, for the terminal and for the browser."""

from dataclasses import dataclass

from arena.game.observation import Board
from arena.game.types import Action, Team
from clients.human.routes import Cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """What an action would do to a unit, as far as its team knows."""

    action: Action
    to: Cell
    """Where it leads."""
    is_open: bool
    why: str = ""
    """What is in the way; empty if nothing is known to be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitView:
    """One own unit, and what it is about to do."""

    index: int
    type: str
    cell: Cell
    alive: bool
    flies: bool
    sight: int
    """In cells, as `attack`."""
    attack: int
    reach: int
    """The greatest squared distance at which it hits, in cells; -1 if it hits nobody."""
    order: str
    """Its order in words."""
    action: Action
    """What it does if the turn ends now."""
    target: Cell | None
    """The cell that it was ordered to."""
    route: tuple[Cell, ...]
    """Cells on the way there, tick by tick."""
    is_fresh: bool
    """Whether it got its order in this turn."""
    is_autopilot: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ViewModel:
    """All that a screen shows of a turn."""

    tick: int
    tick_limit: int
    team: Team
    score: int
    living: tuple[int, int]
    """Own, enemy."""
    time_left_s: float | None
    """Until the turn ends by itself, with the orders as they stand; None where no clock runs."""
    grid: Board
    """What the team sees, in the codes of Table 2."""
    known: Board
    """The same, with the ground that it remembers where nothing is seen now."""
    units: tuple[UnitView, ...]
    selected: int
    """Index of a unit; -1 if none lives."""
    options: tuple[Option, ...]
    """Of the selected unit, one per action."""
    is_complete: bool
    """Whether every living unit got its order in this turn: the turn can end."""
