"""Every unit goes to the column of its own half that borders on the enemy's, and walks up and down there."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import jit
from arena.policy import Orders
from policies.belief.memory import RememberingPolicy, Sight, remember
from policies.chance import draw
from policies.tactics.moves import NORTH, SOUTH, STAY, behind, is_open
from policies.tactics.pursuit import pursue


@jit()
def _act(sight: Any, memory: Any, facts: Any, beat: Any, orders: Any) -> None:
    side = facts.side
    for seat in range(orders.shape[0]):
        remember(seat, sight, memory, facts)
        border = side // 2 - (memory.forward[seat] > 0)
        for unit in range(orders.shape[1]):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell, flies, step = int(sight.cell[seat, unit]), facts.flies[unit], facts.step[unit]
            row, column = cell // side, cell % side
            if abs(column - border) > step // 2:
                orders[seat, unit] = pursue(seat, unit, cell, row * side + border, memory, facts, draw(sight.seed[seat], unit))
                continue
            way = int(beat[seat, unit])
            if not is_open(memory.ground, seat, side, row, column, way, flies):
                way = behind(way)
                beat[seat, unit] = way
            if is_open(memory.ground, seat, side, row, column, way, flies):
                orders[seat, unit] = way


class Patrol(RememberingPolicy):
    """Guards the border."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        n_units = len(ruleset.team(team))
        self._first_beat = np.where(np.arange(n_units) % 2, SOUTH, NORTH).astype(np.int8)
        self._beat = np.tile(self._first_beat, (n_seats, 1))

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen, and which way each unit walked."""
        super().start(seats)
        self._beat[seats] = self._first_beat

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Walk the beat."""
        _act(sight, self.memory, self.facts, self._beat, orders)
