"""The way of one unit to a cell that a person chose, over the ground that the seat remembers."""

import numpy as np
from numpy.typing import NDArray

from arena.game.rules import can_enter, column_after, is_on_board, row_after
from arena.game.ruleset import UnitType
from arena.game.types import Action, Code
from policies.belief.bitrows import UNREACHED
from policies.tactics.moves import head_for
from policies.tactics.paths import downhill, flood

Cell = tuple[int, int]
"""(row, column)."""


class Routes:
    """Ways over one board as it is known now; what was never seen counts as open."""

    def __init__(self, side: int) -> None:
        self._side = side
        self._ground = np.full((1, side * side), Code.HIDDEN, np.int8)
        self._steps = np.zeros((1, side * side), np.int16)
        self._work = np.zeros((19, 64), np.uint64)
        self.find(UnitType(name="walks", step=1, sight=0), (0, 0), (0, 1), ())  # compiled now, before anybody waits for it
        self.find(UnitType(name="flies", step=1, sight=0, flies=True), (0, 0), (0, 1), ())

    def learn(self, ground: NDArray[np.int8]) -> None:
        """Take the ground as it is remembered; int8, shape (side, side)."""
        self._ground[0] = ground.ravel()

    def find(self, kind: UnitType, start: Cell, goal: Cell, taken: tuple[Cell, ...]) -> tuple[list[Action], list[Cell]]:
        """Return what leads a unit to a goal: an action a tick, and the cell after each.

        Parameters
        ----------
        taken
            Cells where others of the own team stand and stay: they are walked around.

        Returns
        -------
        tuple
            Both empty at the goal, and where no way is known. A unit that flies several cells a tick ends as near as it can.
        """
        if kind.step == 0:
            return [], []
        return self._fly(kind.step, start, goal) if kind.flies else self._walk(start, goal, taken)

    def _walk(self, start: Cell, goal: Cell, taken: tuple[Cell, ...]) -> tuple[list[Action], list[Cell]]:
        ground = self._ground.copy()
        for row, column in taken:
            ground[0, row * self._side + column] = Code.OBSTACLE
        if not can_enter(ground[0, self._number(goal)], 0):
            return [], []
        flood(ground, 0, self._side, self._number(goal), self._steps, self._work)
        actions: list[Action] = []
        cells: list[Cell] = []
        at = start
        if self._steps[0, self._number(at)] == UNREACHED:
            return [], []
        while at != goal:
            actions.append(Action(downhill(ground, 0, self._side, self._number(at), self._steps)))
            at = lead(at, actions[-1], 1, self._side)
            cells.append(at)
        return actions, cells

    def _fly(self, step: int, start: Cell, goal: Cell) -> tuple[list[Action], list[Cell]]:
        actions: list[Action] = []
        cells: list[Cell] = []
        at = start
        while True:
            action, _ = head_for(self._ground, 0, self._side, *at, self._number(goal), True, step, 0, np.uint64(0))
            if action == Action.STAY:
                return actions, cells
            actions.append(Action(action))
            at = lead(at, actions[-1], step, self._side)
            cells.append(at)

    def _number(self, cell: Cell) -> int:
        return cell[0] * self._side + cell[1]


def lead(at: Cell, action: Action, step: int, side: int) -> Cell:
    """Return where `step` cells in a direction lead, at most to the border."""
    for _ in range(step):
        beyond = row_after(at[0], action), column_after(at[1], action)
        if is_on_board(*beyond, side):
            at = beyond
    return at
