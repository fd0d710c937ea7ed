"""Units that walk gather around their own flag and go for any enemy on foot that is seen on their half, which they do not leave.

A flag not yet found is looked for by wandering over the own half, as units that fly do all along.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import column_after, row_after
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
def _post(unit: int, flag: int, side: int) -> int:
    """Return a cell beside the flag; each of eight units has its own."""
    place = unit % 8 + (unit % 8 > 3)  # the ninth, the middle, is the flag itself
    row, column = flag // side + place // 3 - 1, flag % side + place % 3 - 1
    return min(max(row, 0), side - 1) * side + min(max(column, 0), side - 1)


@jit(inline=True)
def _intruder(seat: int, sight: Any, memory: Any, facts: Any, row: int, column: int) -> Any:
    enemy = nearest_walker(seat, sight, facts.side, row, column)
    if enemy >= 0 and memory.ground[seat, enemy] in (facts.own_half, facts.own_flag):
        return enemy
    return -1


@jit()
def _act(sight: Any, memory: Any, facts: Any, goals: Any, orders: Any) -> None:
    side = facts.side
    for seat in range(orders.shape[0]):
        remember(seat, sight, memory, facts)
        flag = int(memory.own_flag[seat])
        for unit in range(orders.shape[1]):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell, flies, step = int(sight.cell[seat, unit]), facts.flies[unit], facts.step[unit]
            row, column = cell // side, cell % side
            words = draw(sight.seed[seat], unit)
            goal = -1 if flies else _intruder(seat, sight, memory, facts, row, column)
            if goal < 0 and flag >= 0 and not flies:
                goal = _post(unit, flag, side)
            if goal < 0:
                goal = next_goal(memory.ground, seat, side, cell, goals[seat, unit], -memory.forward[seat], step, words)
                if goal != goals[seat, unit]:
                    goals[seat, unit], memory.detour[seat, unit] = goal, 0
            action = pursue(seat, unit, cell, goal, memory, facts, words)
            to = memory.ground[seat, row_after(row, action) * side + column_after(column, action)]
            if flies or to not in (facts.enemy_half, facts.enemy_flag):
                orders[seat, unit] = action


class Defend(RememberingPolicy):
    """Stays at home."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._goals = np.full((n_seats, len(ruleset.team(team))), -1, np.int16)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen, and where each unit was going."""
        super().start(seats)
        self._goals[seats] = -1

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Chase, guard or look around."""
        _act(sight, self.memory, self.facts, self._goals, orders)
