"""Units that walk go for the nearest enemy on foot in sight, or for the flag where that is nearer.

With neither, they wander over the enemy's half, as units that fly do all along.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import jit
from arena.policy import Orders
from policies.belief.memory import RememberingPolicy, Sight, nearest_walker, remember
from policies.chance import draw
from policies.tactics.moves import STAY
from policies.tactics.pursuit import pursue
from policies.tactics.wandering import next_goal


@jit(inline=True)
def _prey(seat: int, sight: Any, memory: Any, side: int, row: int, column: int) -> Any:
    """Return the cell of the nearer one of flag and enemy, or -1 where neither is known."""
    enemy, flag = nearest_walker(seat, sight, side, row, column), int(memory.enemy_flag[seat])
    if enemy < 0 or flag < 0:
        return max(enemy, flag)
    to_enemy = abs(enemy // side - row) + abs(enemy % side - column)
    to_flag = abs(flag // side - row) + abs(flag % side - column)
    return flag if to_flag <= to_enemy else enemy


@jit()
def _act(sight: Any, memory: Any, facts: Any, goals: Any, orders: Any) -> None:
    side = facts.side
    for seat in range(orders.shape[0]):
        remember(seat, sight, memory, facts)
        for unit in range(orders.shape[1]):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell, flies, step = int(sight.cell[seat, unit]), facts.flies[unit], facts.step[unit]
            row, column = cell // side, cell % side
            words = draw(sight.seed[seat], unit)
            goal = -1 if flies else _prey(seat, sight, memory, side, row, column)
            if goal < 0:
                goal = next_goal(memory.ground, seat, side, cell, goals[seat, unit], memory.forward[seat], step, words)
                if goal != goals[seat, unit]:
                    goals[seat, unit], memory.detour[seat, unit] = goal, 0
            orders[seat, unit] = pursue(seat, unit, cell, goal, memory, facts, words)


class Fighter(RememberingPolicy):
    """Looks for a fight."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._goals = np.full((n_seats, len(ruleset.team(team))), -1, np.int16)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen, and where each unit was going."""
        super().start(seats)
        self._goals[seats] = -1

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Chase, or explore."""
        _act(sight, self.memory, self.facts, self._goals, orders)
