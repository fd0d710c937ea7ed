"""Every unit winds outwards in a square spiral, turns early at what is in its way, and begins anew when as wide as the board.

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

_PITCH = 2
"""Cells between one winding and the next, in ticks of the unit."""


@jit()
def _act(sight: Any, memory: Any, facts: Any, heading: Any, leg: Any, left: Any, orders: Any) -> None:
    side = facts.side
    for seat in range(orders.shape[0]):
        remember(seat, sight, memory, facts)
        flag = int(memory.enemy_flag[seat])
        for unit in range(orders.shape[1]):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell, flies, step = int(sight.cell[seat, unit]), facts.flies[unit], facts.step[unit]
            row, column = cell // side, cell % side
            if flag >= 0 and not flies:
                orders[seat, unit] = pursue(seat, unit, cell, flag, memory, facts, draw(sight.seed[seat], unit))
                continue
            if heading[seat, unit] == STAY or _PITCH * leg[seat, unit] * max(step, 1) > 2 * side:
                heading[seat, unit] = 1 + below(draw(sight.seed[seat], unit)[1], 4)
                leg[seat, unit], left[seat, unit] = 1, _PITCH
            for _ in range(4):
                action = int(heading[seat, unit])
                if left[seat, unit] > 0 and is_open(memory.ground, seat, side, row, column, action, flies):
                    left[seat, unit] -= 1
                    orders[seat, unit] = action
                    break
                heading[seat, unit] = right_of(action)
                leg[seat, unit] += 1
                left[seat, unit] = _PITCH * ((leg[seat, unit] + 1) // 2)


class Spiral(RememberingPolicy):
    """Winds outwards."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        shape = (n_seats, len(ruleset.team(team)))
        self._heading, self._leg, self._left = np.zeros(shape, np.int8), np.zeros(shape, np.int16), np.zeros(shape, np.int16)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen, and every spiral."""
        super().start(seats)
        self._heading[seats] = STAY

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Wind on, or run for the flag."""
        _act(sight, self.memory, self.facts, self._heading, self._leg, self._left, orders)
