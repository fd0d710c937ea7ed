"""Update the beliefs of seats with one observation each."""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter
from arena.jit import jit
from policies.belief.belief import Belief
from policies.belief.bitrows import NONE, bit, count, flood, low_bits
from policies.belief.memory import Sight, remember
from policies.belief.team_rules import TeamRules
from policies.belief.tracks import track


@jit()
def update(sight: Sight, belief: Belief, rules: TeamRules) -> None:
    """Take in one observation of every seat.

    Parameters
    ----------
    sight
        A `memory.Sight` of as many seats as `belief`.
    """
    for seat in range(sight.tick.shape[0]):
        update_seat(seat, sight, belief, rules)


@jit()
def update_seat(seat: int, sight: Sight, belief: Belief, rules: TeamRules) -> None:
    """Take in one observation of one seat."""
    side, is_first = rules.side, belief.tick[seat] < 0
    knew_flag, knew_home = belief.enemy_flag[seat] >= 0, belief.own_flag[seat] >= 0
    is_new = remember(seat, sight, belief.ground, belief.own_flag, belief.enemy_flag, belief.forward, rules)
    if is_first:
        _assume(seat, belief, rules)
    _look(seat, sight, belief, side)
    if is_new or is_first or not knew_flag:
        _narrow(seat, belief.flag_rows, belief.enemy_flag, belief, side)
        belief.n_flag_cells[seat] = count(belief.flag_rows[seat], side)
        flood(belief.flag_rows[seat], belief.walkable[seat], belief.in_sight[seat], 0, side, belief.work, belief.to_flag[seat])
    if is_new or is_first or not knew_home:
        _narrow(seat, belief.home_rows, belief.own_flag, belief, side)
        flood(belief.home_rows[seat], belief.walkable[seat], belief.in_sight[seat], 0, side, belief.work, belief.to_home[seat])
    track(seat, sight, belief, rules, is_first)
    belief.tick[seat] = sight.tick[seat]


@jit()
def _assume(seat: int, belief: Belief, rules: TeamRules) -> None:
    """Set what is believed before anything is seen: the flag of each team lies somewhere on its half."""
    side = rules.side
    west = low_bits(side // 2)
    east = low_bits(side) & ~west
    theirs = east if belief.forward[seat] > 0 else west
    is_blind = True  # nobody is there to see, and so nothing says which half is whose
    for cell in range(side * side):
        is_blind &= belief.ground[seat, cell] < 0
    for row in range(side):
        belief.walkable[seat, row] = low_bits(side)
        belief.enemy_half[seat, row] = theirs
        belief.flag_rows[seat, row] = low_bits(side) if is_blind else theirs
        belief.home_rows[seat, row] = low_bits(side) if is_blind else low_bits(side) & ~theirs


@jit()
def _look(seat: int, sight: Sight, belief: Belief, side: int) -> None:
    """Note which cells are in sight, and what walking and the halves make of them."""
    tick = sight.tick[seat]
    for row in range(side):
        seen, walls = NONE, NONE
        first = row * side
        for column in range(side):
            code = sight.ground[seat, first + column]
            seen |= np.uint64(code >= 0) << np.uint64(column)
            walls |= np.uint64(not can_enter(code, 0)) << np.uint64(column)
            belief.seen_at[seat, first + column] = tick if code >= 0 else belief.seen_at[seat, first + column]
        belief.in_sight[seat, row] = seen
        belief.walkable[seat, row] &= ~walls


@jit()
def _narrow(seat: int, rows: NDArray[np.uint64], flag: NDArray[np.int16], belief: Belief, side: int) -> None:
    """Take from where a flag may lie what is in sight without it; a flag that is seen lies there.

    On a board of its own drawing a flag may lie on the other half: with nothing left, any cell that was never seen is possible.
    """
    cell = int(flag[seat])
    is_empty = True
    for row in range(side):
        rows[seat, row] &= ~belief.in_sight[seat, row]
        if cell >= 0:
            rows[seat, row] = bit(cell % side) if cell // side == row else NONE
        is_empty &= rows[seat, row] == NONE
    if is_empty:
        for row in range(side):
            for column in range(side):
                if belief.seen_at[seat, row * side + column] < 0:
                    rows[seat, row] |= bit(column)
