"""A fighter that orders one unit after another, from what its seat remembers."""

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import jit
from arena.policy import Orders
from policies.belief.memory import SeatMemory, Sight, forget_memory, make_memory, remember
from policies.belief.team_rules import TeamRules
from policies.heuristics.compiled import CompiledPolicy
from policies.tactics.moves import STAY


def each_unit(module: str, *, remembers: bool = True) -> Callable[[Sight, SeatMemory, TeamRules, Orders], None]:
    """Return the kernel that orders all seats by a module's `order_unit(seat, unit, cell, sight, memory, rules) -> action`.

    Parameters
    ----------
    remembers
        Whether the map is kept; without it, a fighter knows what it sees.
    """
    script = sys.modules[module]

    def act(sight: Sight, memory: SeatMemory, rules: TeamRules, orders: Orders) -> None:
        for seat in range(orders.shape[0]):
            if remembers:
                knew_flag = memory.enemy_flag[seat] >= 0
                is_new = remember(seat, sight, memory.ground, memory.own_flag, memory.enemy_flag, memory.forward, rules)
                if is_new or not knew_flag:
                    memory.is_map_new[seat] = 1
            for unit in range(orders.shape[1]):
                orders[seat, unit] = STAY
                if sight.alive[seat, unit]:
                    orders[seat, unit] = script.order_unit(seat, unit, int(sight.cell[seat, unit]), sight, memory, rules)

    act.__qualname__ = f"act_{module.rpartition('.')[2]}"  # by which numba names its cache files: one for each fighter
    return jit()(act)


class UnitByUnit(CompiledPolicy):
    """A fighter whose `kernel` is `each_unit` of its module. Its memory is cleared when a match begins."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        self.memory = make_memory(n_seats, len(ruleset.team(team)), ruleset.side**2)
        super().__init__(ruleset, team, n_seats, self.memory)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Clear the memory of some seats."""
        forget_memory(self.memory, seats)
