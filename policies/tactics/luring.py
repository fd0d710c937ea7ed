"""Against an enemy that stays at home: one unit shows itself to the guards and leads them away, and the others run for the flag.

The decoy keeps so near that guards who come see it, so far that none can hit it, and goes where the way to their flag is longest.
The others wait on their own half, as near to the flag as that goes. Whoever can be there before every guard in sight runs.
"""

from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import UNREACHED, has
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.tactics.moves import STAY
from policies.tactics.odds import can_hit, squared
from policies.tactics.roles import ATTACK, DECOY, WAIT, Plan, assign_role, find_way, step_to

_UNTIL = 0.7
"""Share of the match after which there is no time left for it. Measured against `defend`: better than 0.6, 0.8 and 0.9."""
_REMEMBERS = 25
"""For how many ticks guards that left their flag are taken to come back to it."""
_BOLD = 12
"""Once in so many ticks, a decoy that no guard sees steps up to where one does, which may cost it a fight."""
_FALLS, _UNSEEN, _TAKEN = 5000, 200, 50
"""What it costs a decoy to be hit, to be out of everybody's sight, and to want a friend's cell; in steps."""
_FAR = 900


@jit()
def lure(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Make decoy and waiting units of those attackers that cannot win the race to the flag, unless ahead or late."""
    n_attackers = 0
    for unit in range(plan.role.shape[0]):
        n_attackers += plan.role[unit] == ATTACK
    is_late = sight.tick[seat] >= _UNTIL * rules.tick_limit
    if is_late or sight.score[seat] > 0 or belief.enemy_flag[seat] < 0 or n_attackers < 2:
        return
    if sight.tick[seat] - plan.guarded_at[seat] > _REMEMBERS:
        return
    first = UNREACHED
    for place in range(sight.enemy_cell.shape[1]):
        at = int(sight.enemy_cell[seat, place])
        if at < 0:
            break
        if not sight.enemy_flies[seat, place]:
            first = min(first, int(belief.to_flag[seat, at]))
    side = rules.side
    theirs = side // 2 if belief.forward[seat] > 0 else side // 2 - 1
    ours = 2 * (side // 2) - 1 - theirs
    find_way(_farthest(theirs, 1, seat, belief, side), DECOY, seat, belief, plan, side)
    find_way(_farthest(ours, -1, seat, belief, side), WAIT, seat, belief, plan, side)
    for unit in range(plan.role.shape[0]):
        if plan.role[unit] == ATTACK and belief.to_flag[seat, sight.cell[seat, unit]] > first:
            plan.role[unit] = WAIT
    decoy = assign_role(WAIT, DECOY, UNREACHED, seat, sight, plan)
    if decoy >= 0:
        _move_decoy(seat, decoy, sight, belief, rules, plan, orders)


@jit(inline=True)
def _farthest(column: int, sign: int, seat: int, belief: Belief, side: int) -> int:
    """Return the cell of a column that is farthest from the flag on foot, or nearest for a `sign` of -1; -1 without a way."""
    chosen, most = -1, 0
    for row in range(side):
        cell = row * side + column
        far = int(belief.to_flag[seat, cell])
        if far < UNREACHED and has(belief.walkable[seat], side, cell) and (chosen < 0 or sign * far > most):
            chosen, most = cell, sign * far
    return chosen


@jit()
def _move_decoy(seat: int, unit: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Show the decoy to the guards, lead away those that come, and let none of them hit it."""
    side, cell, view = rules.side, int(sight.cell[seat, unit]), rules.sight_cells[unit] * rules.sight_cells[unit]
    is_bold = sight.tick[seat] % _BOLD == 0 and _nearest(seat, cell, sight, side) > view
    best, least, target = STAY, 0, -1
    for action in range(5 if rules.step[unit] else 1):
        to = step_to(cell, action, seat, belief, side)
        if to < 0:
            continue
        is_hit, is_followed, far, nearest = False, False, _FAR, 2 * side * side
        for place in range(sight.enemy_cell.shape[1]):
            at = int(sight.enemy_cell[seat, place])
            if at < 0:
                break
            if sight.enemy_flies[seat, place]:
                continue
            down, right = abs(at // side - to // side), abs(at % side - to % side)
            longer, shorter = max(down, right), min(down, right)
            after = longer * longer + (shorter - 1) * (shorter - 1) if shorter > 0 else (longer - 1) * (longer - 1)
            is_followed |= after <= view  # whichever way it comes
            is_hit |= can_hit(at, sight.enemy_type[seat, place], to, rules) > 0.0
            far, nearest = min(far, longer + shorter), min(nearest, squared(at, to, side))
        if is_bold:
            is_hit = nearest < view
        if is_hit:
            cost = _FALLS - nearest
        elif is_bold and nearest <= view:
            cost = 0
        elif is_followed:
            cost = min(int(plan.way[DECOY, to]), _UNSEEN)
        else:
            cost = _UNSEEN + (far if far < _FAR else _FAR + min(int(belief.to_flag[seat, to]), _FAR))
        for other in range(plan.aim.shape[0]):
            if other != unit and not rules.flies[other] and sight.alive[seat, other] and sight.cell[seat, other] == to:
                cost += _TAKEN
        if target < 0 or cost < least:
            best, least, target = action, cost, to
    orders[seat, unit] = best
    plan.aim[unit], plan.is_decided[unit], plan.decoy[0] = target, 1, target


@jit(inline=True)
def _nearest(seat: int, cell: int, sight: Sight, side: int) -> int:
    """Return the squared distance to the nearest enemy on foot in sight."""
    least = 2 * side * side
    for place in range(sight.enemy_cell.shape[1]):
        at = int(sight.enemy_cell[seat, place])
        if at < 0:
            break
        if not sight.enemy_flies[seat, place]:
            least = min(least, squared(at, cell, side))
    return least
