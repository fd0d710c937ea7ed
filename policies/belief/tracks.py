"""Where each enemy on foot may be: one set of cells for each, which spreads by a step a tick and is cleared by sight.

Enemies have no index, so nobody knows which of two went where. The sets are kept so that this never matters: there is always a
way to give each living enemy a set of its own that contains it. Wherever a set is taken for one enemy and could as well have been
another's, that other gets all that the set held.
"""

from arena.jit import jit
from policies.belief.belief import FALLEN, HIDDEN_NOW, Belief
from policies.belief.bitrows import NONE, bit, count, has, low_bits, spread
from policies.belief.memory import Sight
from policies.belief.team_rules import TeamRules

_EVERYWHERE = 64
"""After so many steps an enemy may be anywhere on its side of the walls."""


@jit()
def track(seat: int, sight: Sight, belief: Belief, rules: TeamRules, is_first: bool) -> None:
    """Take in where enemies are seen, where none is, and how many live."""
    side, n_walkers = rules.side, belief.enemy_cell.shape[1]
    living = min(max(int(sight.living[seat, 1]) - rules.n_enemy_flyers, 0), n_walkers)
    if is_first:
        _assume(seat, sight, belief, rules)
    n_steps = min((sight.tick[seat] - belief.tick[seat]) * rules.enemy_step, _EVERYWHERE)
    for enemy in range(n_walkers):
        if belief.enemy_cell[seat, enemy] == FALLEN:
            continue
        belief.enemy_cell[seat, enemy] = HIDDEN_NOW
        if not is_first:
            for _ in range(n_steps):
                spread(belief.enemy_rows[seat, enemy], belief.walkable[seat], side)
    for place in range(sight.enemy_cell.shape[1]):
        cell = int(sight.enemy_cell[seat, place])
        if cell < 0:
            break
        if not sight.enemy_flies[seat, place]:
            _recognise(seat, cell, belief, side)
    n_tracks = 0
    for enemy in range(n_walkers):
        n_tracks += belief.enemy_cell[seat, enemy] != FALLEN
        if belief.enemy_cell[seat, enemy] == HIDDEN_NOW:
            for row in range(side):
                belief.enemy_rows[seat, enemy, row] &= ~belief.in_sight[seat, row] & belief.walkable[seat, row]
    for _ in range(n_tracks - living):
        _drop_track(seat, belief, side)
    _restore_lost(seat, belief, side)
    belief.n_enemies[seat] = living


@jit()
def _assume(seat: int, sight: Sight, belief: Belief, rules: TeamRules) -> None:
    """Before the first tick every enemy stands on its own half; later, or with nobody to see which half that is, anywhere."""
    for enemy in range(belief.enemy_cell.shape[1]):
        belief.enemy_cell[seat, enemy] = HIDDEN_NOW
        for row in range(rules.side):
            is_anywhere = sight.tick[seat] > 0 or sight.cell.shape[1] == 0
            belief.enemy_rows[seat, enemy, row] = low_bits(rules.side) if is_anywhere else belief.enemy_half[seat, row]


@jit()
def _recognise(seat: int, cell: int, belief: Belief, side: int) -> None:
    """Give an enemy in sight the smallest set that it may have come from."""
    chosen, least, is_known = -1, 0, False
    for enemy in range(belief.enemy_cell.shape[1]):
        if belief.enemy_cell[seat, enemy] != HIDDEN_NOW:
            continue
        size = count(belief.enemy_rows[seat, enemy], side)
        is_possible = has(belief.enemy_rows[seat, enemy], side, cell)
        if chosen < 0 or (is_possible and not is_known) or (is_possible == is_known and size < least):
            chosen, least, is_known = enemy, size, is_possible
    if chosen < 0:
        return
    for enemy in range(belief.enemy_cell.shape[1]):
        is_other = enemy != chosen and belief.enemy_cell[seat, enemy] == HIDDEN_NOW
        if is_other and has(belief.enemy_rows[seat, enemy], side, cell):
            for row in range(side):
                belief.enemy_rows[seat, enemy, row] |= belief.enemy_rows[seat, chosen, row]
    belief.enemy_cell[seat, chosen] = cell
    for row in range(side):
        belief.enemy_rows[seat, chosen, row] = bit(cell % side) if row == cell // side else NONE


@jit()
def _drop_track(seat: int, belief: Belief, side: int) -> None:
    """Drop the smallest set of those out of sight; if it was not the fallen one's, its owner may go on in any other."""
    chosen, least = -1, 0
    for enemy in range(belief.enemy_cell.shape[1]):
        size = count(belief.enemy_rows[seat, enemy], side)
        if belief.enemy_cell[seat, enemy] == HIDDEN_NOW and (chosen < 0 or size < least):
            chosen, least = enemy, size
    if chosen < 0:
        return
    belief.enemy_cell[seat, chosen] = FALLEN
    for row in range(side):
        left = belief.enemy_rows[seat, chosen, row]
        belief.enemy_rows[seat, chosen, row] = NONE
        for enemy in range(belief.enemy_cell.shape[1]):
            if belief.enemy_cell[seat, enemy] == HIDDEN_NOW:
                belief.enemy_rows[seat, enemy, row] |= left


@jit()
def _restore_lost(seat: int, belief: Belief, side: int) -> None:
    """Let an enemy that can be nowhere be anywhere out of sight: not all that was assumed holds on a board of its own drawing."""
    for enemy in range(belief.enemy_cell.shape[1]):
        if belief.enemy_cell[seat, enemy] == HIDDEN_NOW and count(belief.enemy_rows[seat, enemy], side) == 0:
            for row in range(side):
                belief.enemy_rows[seat, enemy, row] = belief.walkable[seat, row] & ~belief.in_sight[seat, row]
