"""Each unit stays or takes a step that may be open, at random."""

from arena.game.philox import below
from arena.jit import jit
from policies.belief.memory import SeatMemory, Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.heuristics.unit_by_unit import UnitByUnit, each_unit
from policies.tactics.moves import EAST, NORTH, SOUTH, STAY, WEST, is_open


@jit(inline=True)
def order_unit(seat: int, unit: int, cell: int, sight: Sight, memory: SeatMemory, rules: TeamRules) -> int:
    """Return one of the open steps, or STAY, each as likely."""
    row, column, flies = cell // rules.side, cell % rules.side, rules.flies[unit]
    n_open = 1
    for action in (NORTH, EAST, SOUTH, WEST):
        n_open += is_open(sight.ground, seat, rules.side, row, column, action, flies)
    choice, chosen = below(draw(sight.seed[seat], unit)[0], n_open), STAY
    for action in (NORTH, EAST, SOUTH, WEST):
        if is_open(sight.ground, seat, rules.side, row, column, action, flies):
            if choice == 1:
                chosen = action
            choice -= 1
    return chosen


class Random(UnitByUnit):
    """Moves at random."""

    kernel = each_unit(__name__, remembers=False)
