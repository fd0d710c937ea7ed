"""Any order that may move the unit, or staying: one of them at random."""

from typing import Any

from arena.game.philox import below
from arena.jit import jit
from arena.policy import Orders
from policies.belief.memory import RememberingPolicy, Sight
from policies.chance import draw
from policies.tactics.moves import EAST, NORTH, SOUTH, STAY, WEST, is_open


@jit()
def _act(sight: Any, facts: Any, orders: Any) -> None:
    side = facts.side
    for seat in range(orders.shape[0]):
        for unit in range(orders.shape[1]):
            orders[seat, unit] = STAY
            if not sight.alive[seat, unit]:
                continue
            cell = int(sight.cell[seat, unit])
            row, column, flies = cell // side, cell % side, facts.flies[unit]
            n_open = 1
            for action in (NORTH, EAST, SOUTH, WEST):
                n_open += is_open(sight.ground, seat, side, row, column, action, flies)
            choice = below(draw(sight.seed[seat], unit)[0], n_open)
            for action in (NORTH, EAST, SOUTH, WEST):
                if is_open(sight.ground, seat, side, row, column, action, flies):
                    if choice == 1:
                        orders[seat, unit] = action
                    choice -= 1


class Random(RememberingPolicy):
    """Moves at random."""

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Draw one order for each living unit."""
        _act(sight, self.facts, orders)
