"""Every unit goes straight on until it bumps, then turns at random, as a cleaning robot does.

Once the enemy's flag was seen, units that walk go for it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.philox import below
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import jit
from arena.policy import Orders
from policies.belief.memory import RememberingPolicy, Sight, remember
from policies.chance import draw
from policies.tactics.moves import STAY, is_open, right_of
from policies.tactics.pursuit import pursue


@jit()
def _act(sight: Any, memory: Any, facts: Any, heading: Any, before: Any, orders: Any) -> None:
    side = facts.side
    for seat in range(orders.shape[0]):
        remember(seat, sight, memory, facts)
        flag = int(memory.enemy_flag[seat])
        for unit in range(orders.shape[1]):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell, flies = int(sight.cell[seat, unit]), facts.flies[unit]
            row, column = cell // side, cell % side
            words = draw(sight.seed[seat], unit)
            if flag >= 0 and not flies:
                orders[seat, unit] = pursue(seat, unit, cell, flag, memory, facts, words)
                continue
            action = int(heading[seat, unit])
            is_bumped = action == STAY or cell == before[seat, unit]
            if is_bumped or not is_open(memory.ground, seat, side, row, column, action, flies):
                action = 1 + below(words[1], 4)
                for _ in range(4):
                    if is_open(memory.ground, seat, side, row, column, action, flies):
                        break
                    action = right_of(action)
            heading[seat, unit], before[seat, unit] = action, cell
            if is_open(memory.ground, seat, side, row, column, action, flies):
                orders[seat, unit] = action


class Roomba(RememberingPolicy):
    """Bounces about the board."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        n_units = len(ruleset.team(team))
        self._heading = np.zeros((n_seats, n_units), np.int8)
        self._before = np.full((n_seats, n_units), -1, np.int16)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen, and where each unit was going."""
        super().start(seats)
        self._heading[seats] = STAY
        self._before[seats] = -1

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Go on, or turn."""
        _act(sight, self.memory, self.facts, self._heading, self._before, orders)
