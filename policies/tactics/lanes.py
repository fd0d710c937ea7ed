"""At home, where nobody is seen to come: two lanes lead from the border to the back, and who waits there closes one of them."""

from arena.jit import jit
from policies.belief.belief import Belief
from policies.belief.bitrows import UNREACHED, has
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.tactics.roles import ATTACK, NORTH, SOUTH, Plan, assign_role, find_way

_BEHIND = 0.35
"""How far behind the border they wait, as a share of the board. Measured: as good as 0.25 and 0.15 against those who raid, and
better against those who wait as well, whom they attack from there in the second half.
"""


@jit()
def hold_lanes(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan) -> None:
    """Send the attackers to the lanes by turns, whoever is nearest first."""
    find_way(_post(1, seat, belief, rules.side), NORTH, seat, belief, plan, rules.side)
    find_way(_post(3, seat, belief, rules.side), SOUTH, seat, belief, plan, rules.side)
    for _ in range(plan.role.shape[0]):
        assign_role(ATTACK, NORTH, UNREACHED, seat, sight, plan)
        assign_role(ATTACK, SOUTH, UNREACHED, seat, sight, plan)


@jit()
def _post(quarters: int, seat: int, belief: Belief, side: int) -> int:
    """Return the cell with ground in the column of the posts that is nearest to so many quarters of the way down; or -1."""
    behind = int(_BEHIND * side)
    column = side // 2 - behind if belief.forward[seat] > 0 else side // 2 - 1 + behind
    middle = quarters * side // 4
    for away in range(side):
        for row in (middle - away, middle + away):
            cell = row * side + column
            if 0 <= row < side and has(belief.walkable[seat], side, cell) and belief.to_home[seat, cell] < UNREACHED:
                return cell
    return -1
