"""All units sweep the enemy's half in lanes, one to each, until its flag is seen.

Then every unit that walks runs the shortest way known, taking for open what nobody has seen; the others go on sweeping.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import jit
from arena.policy import Orders
from policies.belief.memory import RememberingPolicy, Sight, remember
from policies.chance import draw, one_in
from policies.tactics.moves import STAY
from policies.tactics.paths import UNREACHED, downhill, flood
from policies.tactics.pursuit import pursue

_PATIENCE = 64
"""A lane's end is given up in one tick of so many: it may lie behind walls."""


@jit(inline=True)
def _lane_end(leg: int, unit: int, n_units: int, side: int, forward: int) -> int:
    """Return where a leg ends: in and out of the enemy's half by turns, each pair half a lane further down."""
    row = ((2 * unit + 1 + leg // 2) * side // (2 * n_units)) % side
    is_far = leg % 4 in (1, 2)
    if forward > 0:
        return row * side + (side - 1 if is_far else side // 2)
    return row * side + (0 if is_far else side // 2 - 1)


@jit()
def _act(sight: Any, memory: Any, facts: Any, legs: Any, steps: Any, queue: Any, orders: Any) -> None:
    side, n_units = facts.side, orders.shape[1]
    for seat in range(orders.shape[0]):
        is_flag_new = memory.enemy_flag[seat] < 0
        is_ground_new = remember(seat, sight, memory, facts)
        flag, forward = int(memory.enemy_flag[seat]), int(memory.forward[seat])
        if flag >= 0 and (is_flag_new or is_ground_new):
            flood(memory.ground, seat, side, flag, steps, queue)
        for unit in range(n_units):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell, flies, step = int(sight.cell[seat, unit]), facts.flies[unit], facts.step[unit]
            row, column = cell // side, cell % side
            if flag >= 0 and not flies and steps[seat, cell] < UNREACHED:
                orders[seat, unit] = downhill(memory.ground, seat, side, row, column, steps)
                continue
            words = draw(sight.seed[seat], unit)
            goal = _lane_end(int(legs[seat, unit]), unit, n_units, side, forward)
            is_there = abs(goal // side - row) <= step // 2 and abs(goal % side - column) <= step // 2
            if is_there or not can_enter(memory.ground[seat, goal], flies) or one_in(words[1], _PATIENCE):
                legs[seat, unit], memory.detour[seat, unit] = (legs[seat, unit] + 1) % (8 * n_units), 0
                goal = _lane_end(int(legs[seat, unit]), unit, n_units, side, forward)
            orders[seat, unit] = pursue(seat, unit, cell, goal, memory, facts, words)


class Rush(RememberingPolicy):
    """Finds the flag and runs for it."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._legs = np.zeros((n_seats, len(ruleset.team(team))), np.int16)
        self._steps = np.zeros((n_seats, ruleset.side**2), np.int16)
        self._queue = np.zeros(ruleset.side**2, np.int16)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen, and how far each unit has swept."""
        super().start(seats)
        self._legs[seats] = 0

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Sweep, or run."""
        _act(sight, self.memory, self.facts, self._legs, self._steps, self._queue, orders)
