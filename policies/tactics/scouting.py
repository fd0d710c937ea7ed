"""Units that fly: they look for the enemy's flag where it is likeliest; then one watches it, the other our own, or the decoy."""

import numpy as np
from numpy.typing import NDArray

from arena.game.bits import lowest_bit, popcount
from arena.game.compiled import column_after, is_in_sight, is_on_board, row_after, squared_distance
from arena.jit import jit
from arena.policy import Orders
from policies.belief.belief import Belief
from policies.belief.bitrows import NONE, ONE, low_bits
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules
from policies.chance import draw
from policies.tactics.moves import STAY
from policies.tactics.roles import Plan

_NEW_CELL = 3
"""What a new cell in sight is worth, in steps towards the nearest one."""


@jit()
def order_flyers(seat: int, sight: Sight, belief: Belief, rules: TeamRules, plan: Plan, orders: Orders) -> None:
    """Write the orders of the units that fly. What one will see, the next need not look at."""
    flag = int(belief.enemy_flag[seat])
    for row in range(rules.side):
        plan.unseen[row] = belief.flag_rows[seat, row] if flag < 0 else NONE
    n_before = 0
    for unit in range(orders.shape[1]):
        if not rules.flies[unit] or not sight.alive[seat, unit]:
            continue
        cell = int(sight.cell[seat, unit])
        goal = flag
        if n_before % 2 == 1:
            goal = int(plan.decoy[0]) if plan.decoy[0] >= 0 else int(belief.own_flag[seat])
        if flag < 0:
            goal = _nearest(plan.unseen, rules.side, cell)
        orders[seat, unit] = _look(seat, unit, cell, goal, sight, rules, plan.unseen, flag < 0)
        n_before += 1


@jit(inline=True)
def _nearest(rows: NDArray[np.uint64], side: int, cell: int) -> int:
    """Return the cell of a set that is fewest steps away, or -1."""
    nearest, least = -1, 2 * side
    for row in range(side):
        rest = rows[row]
        while rest != NONE:
            column = lowest_bit(rest)
            rest &= rest - ONE
            far = abs(cell // side - row) + abs(cell % side - column)
            if far < least:
                nearest, least = row * side + column, far
    return nearest


@jit(inline=True)
def _disc_row(row: int, column: int, to: int, sight_cells: int, side: int) -> np.uint64:
    """Return the cells of one row that are seen from a cell."""
    width, down = -1, abs(to - row)
    while is_in_sight(squared_distance(width + 1, down), sight_cells):
        width += 1
    return low_bits(min(column + width + 1, side)) & ~low_bits(max(column - width, 0)) if width >= 0 else NONE


@jit(inline=True)
def _look(
    seat: int, unit: int, cell: int, goal: int, sight: Sight, rules: TeamRules, unseen: NDArray[np.uint64], is_searching: bool
) -> int:
    """Return the action that shows most of `unseen`, or leads to `goal`; take from `unseen` what it shows."""
    side, reach = rules.side, rules.sight_cells[unit]
    first = int(draw(sight.seed[seat], unit)[0] & np.uint64(3))
    best, most, best_row, best_column = STAY, 0, -1, -1
    for turn in range(5):
        action = STAY if turn == 0 else 1 + (turn + first) % 4
        row, column = cell // side, cell % side
        for _ in range(rules.step[unit]):
            if is_on_board(row_after(row, action), column_after(column, action), side):
                row, column = row_after(row, action), column_after(column, action)
        if action != STAY and row * side + column == cell:
            continue
        value = 0
        for to in range(max(row - reach, 0), min(row + reach + 1, side) if is_searching else 0):
            value += _NEW_CELL * popcount(unseen[to] & _disc_row(row, column, to, reach, side))
        if goal >= 0:
            value -= abs(goal // side - row) + abs(goal % side - column)
        if best_row < 0 or value > most:
            best, most, best_row, best_column = action, value, row, column
    for to in range(max(best_row - reach, 0), min(best_row + reach + 1, side) if is_searching else 0):
        unseen[to] &= ~_disc_row(best_row, best_column, to, reach, side)
    return best
