"""What may be: worlds that agree with all that a seat was shown, each with a model of the enemy by which it went on.

A world goes on by the enemy's model, and then what is seen corrects it: enemies in sight stand where they are seen, the others
out of sight where the belief's tracks let them be, and as many live as do. How much there was to correct tells likely worlds
from others, and unlikely ones make room. So the models that foresaw what happened are the ones that stay.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.kernel import shape_of
from arena.game.move import move
from arena.game.state import Rule, StateField, Tables, Trait
from arena.game.types import Code, Termination
from arena.jit import jit
from policies.belief.belief import Belief
from policies.belief.bitrows import has
from policies.belief.memory import Sight
from policies.chance import choose, mix
from policies.search.models import ASSIGN_EVERY, assign_roles
from policies.search.playout import Bench
from policies.search.roles import order_team_anew
from policies.search.worlds import copy_world, units_of

_OBSTACLE = int(Code.OBSTACLE)
_MISPLACED, _MOST_STEPS = 0.35, 3
"""By how much a world is less likely for each step by which it misplaced an enemy in sight, and how many count."""
_UNSEEN = 0.5
"""And for an enemy that should have been in sight, or cannot be where it is."""
_FELL_NEAR, _FELL_FAR, _FELL_NOWHERE = 1.0, 0.5, 0.2
"""And for one that fell: near an own unit on foot, farther off, and where none was."""
_NEAR, _FAR = 9, 25
"""What is near, as squared distances."""
_TRIES = 64


class Weights(NamedTuple):
    """Scratch for a tick of the filter."""

    likely: NDArray[np.float64]
    """Shape (worlds,)."""
    source: NDArray[np.int64]
    """Shape (worlds,): the world that each goes on from."""


def make_weights(n_worlds: int) -> Weights:
    """Return scratch."""
    return Weights(np.zeros(n_worlds), np.zeros(n_worlds, np.int64))


@jit()
def lay_ground(me: int, belief: Belief, bench: Bench) -> None:
    """Write the ground as it is believed into every world: obstacles where some were seen, and the halves."""
    ground, side = bench.now.state.ground, int(bench.tables.rule[Rule.SIDE])
    for cell in range(side * side):
        code = 1 - me if has(belief.enemy_half[0], side, cell) else me
        if not has(belief.walkable[0], side, cell):
            code = _OBSTACLE
        for world in range(ground.shape[0]):
            ground[world, cell] = code


@jit()
def begin(me: int, belief: Belief, bench: Bench, seed: np.uint64) -> None:
    """Draw worlds of which nothing is known but the ground; `follow` places all that is seen."""
    now, side = bench.now, int(bench.tables.rule[Rule.SIDE])
    foe, flyers, last = units_of(1 - me, bench.tables)
    for world in range(now.role.shape[0]):
        word = mix(seed ^ mix(np.uint64(world)))
        now.model[world, me], now.model[world, 1 - me] = 0, choose(word, bench.rows.shape[0])
        for team in range(2):
            now.knows[world, team], now.raided[world, team] = 0, 0
        for unit in range(foe, last):
            word = mix(word)
            now.state.alive[world, unit], now.goal[world, unit] = 1, -1
            now.state.cell[world, unit] = _draw(belief.enemy_half[0], unit < flyers, belief, word, side)
        now.state.field[world, StateField.BLUE_FLAG], now.state.field[world, StateField.RED_FLAG] = -1, -1


@jit()
def follow(
    me: int,
    sight: Sight,
    belief: Belief,
    last_orders: NDArray[np.int8],
    is_first: bool,
    mutates: int,
    bench: Bench,
    weights: Weights,
    seed: np.uint64,
) -> None:
    """Take what a seat is shown into its worlds.

    Parameters
    ----------
    sight, belief
        Of one seat; the belief is up to date.
    last_orders
        int8, shape (own units,): those that the seat gave at the tick before.
    is_first
        Whether the worlds were drawn just now.
    mutates
        One world in so many takes another model.
    seed
        Of this tick.
    """
    now, tables, state = bench.now, bench.tables, bench.now.state
    tick, score = int(sight.tick[0]), int(sight.score[0])
    own, _, own_last = units_of(me, tables)
    shape = shape_of(tables)
    for world in range(now.role.shape[0]):
        salt = mix(seed ^ mix(np.uint64(world)))
        if not is_first:
            if tick % ASSIGN_EVERY == 1:
                assign_roles(world, 1 - me, now, bench.ways, tables, bench.rows)
            order_team_anew(world, 1 - me, now, bench.ways, tables, bench.rows, bench.desk, salt, bench.orders)
            for unit in range(own, own_last):
                bench.orders[world, unit] = last_orders[unit - own]
            move(world, shape, state, bench.orders, tables, bench.work)
        for unit in range(own, own_last):
            state.cell[world, unit], state.alive[world, unit] = sight.cell[0, unit - own], sight.alive[0, unit - own]
        _place_flags(me, world, belief, bench, salt)
        weights.likely[world] = _correct(me, world, sight, belief, bench, salt)
        field = state.field[world]
        field[StateField.TICK], field[StateField.ENDING], field[StateField.WINNER] = tick, Termination.RUNNING, -1
        field[StateField.SCORE] = -score if me else score
        field[StateField.BLUE_LIVING + me], field[StateField.RED_LIVING - me] = sight.living[0, 0], sight.living[0, 1]
        now.knows[world, me] = belief.enemy_flag[0] >= 0
        for purpose in range(2):
            for team in range(2):
                word = mix(salt + np.uint64(1 + 2 * purpose + team))
                state.key[world, purpose, team, 0] = np.uint32(word & np.uint64(0xFFFFFFFF))
                state.key[world, purpose, team, 1] = np.uint32(word >> np.uint64(32))
    _resample(me, mutates, bench, weights, seed)


@jit(inline=True)
def _place_flags(me: int, world: int, belief: Belief, bench: Bench, salt: np.uint64) -> None:
    """Let flags lie where they are known to, or where they may."""
    field, side = bench.now.state.field, int(bench.tables.rule[Rule.SIDE])
    for is_own in range(2):
        column = StateField.BLUE_FLAG + me if is_own else StateField.RED_FLAG - me
        known = int(belief.own_flag[0] if is_own else belief.enemy_flag[0])
        rows = belief.home_rows[0] if is_own else belief.flag_rows[0]
        cell = int(field[world, column])
        if known >= 0:
            field[world, column] = known
        elif cell < 0 or not has(rows, side, cell) or not has(belief.walkable[0], side, cell):
            field[world, column] = _draw(rows, True, belief, salt + np.uint64(is_own), side)


@jit()
def _draw(rows: NDArray[np.uint64], walks: bool, belief: Belief, word: np.uint64, side: int) -> int:
    """Return a random cell of a set that is out of sight, and not known as an obstacle where a unit walks; if there is one."""
    n_cells = side * side
    for attempt in range(_TRIES + n_cells):
        cell = _try_cell(attempt, word, n_cells)
        if has(rows, side, cell) and _is_hidden(cell, walks, belief, side):
            return cell
    return choose(word, n_cells)


@jit(inline=True)
def _try_cell(attempt: int, word: np.uint64, n_cells: int) -> int:
    """Return a cell at random, and after `_TRIES` attempts each by turns."""
    return choose(mix(word + np.uint64(attempt)), n_cells) if attempt < _TRIES else (choose(word, n_cells) + attempt) % n_cells


@jit(inline=True)
def _is_hidden(cell: int, walks: bool, belief: Belief, side: int) -> bool:
    """Whether an enemy may stand on a cell and not be seen."""
    return not has(belief.in_sight[0], side, cell) and (not walks or has(belief.walkable[0], side, cell))


@jit(inline=True)
def _may_be(cell: int, walks: bool, belief: Belief, side: int) -> bool:
    """Whether an enemy out of sight may be in a cell, by its track."""
    is_tracked = not walks
    for enemy in range(belief.enemy_rows.shape[1] if walks else 0):
        is_tracked |= has(belief.enemy_rows[0, enemy], side, cell)
    return is_tracked and _is_hidden(cell, walks, belief, side)


@jit(inline=True)
def _correct(me: int, world: int, sight: Sight, belief: Belief, bench: Bench, salt: np.uint64) -> float:
    """Put the enemies of a world where they are seen, or out of sight; return how likely the world was."""
    state, tables, likely = bench.now.state, bench.tables, 1.0
    side = int(tables.rule[Rule.SIDE])
    foe, flyers, last = units_of(1 - me, tables)
    taken = 0
    for place in range(sight.enemy_cell.shape[1]):
        cell = int(sight.enemy_cell[0, place])
        if cell < 0:
            break
        unit, steps = _recognise(world, cell, int(sight.enemy_type[0, place]), taken, foe, last, bench, side)
        if unit < 0:
            continue
        taken |= 1 << unit
        state.cell[world, unit], state.alive[world, unit] = cell, 1
        if unit < flyers:
            likely *= _MISPLACED ** min(steps, _MOST_STEPS)
    living = int(sight.living[0, 1]) - (last - flyers)
    n_living = 0
    for unit in range(foe, flyers):
        n_living += state.alive[world, unit]
    while n_living > living:
        unit, apart = _nearest_to_own(me, world, taken, foe, flyers, bench)
        if unit < 0:
            break
        state.alive[world, unit] = 0
        n_living -= 1
        likely *= _FELL_NEAR if apart <= _NEAR else _FELL_FAR if apart <= _FAR else _FELL_NOWHERE
    for unit in range(foe, flyers):
        if n_living < living and not state.alive[world, unit]:
            state.alive[world, unit] = 1
            n_living += 1
    for unit in range(foe, last):
        cell = int(state.cell[world, unit])
        if state.alive[world, unit] and not (taken >> unit) & 1 and not _may_be(cell, unit < flyers, belief, side):
            state.cell[world, unit] = _elsewhere(cell, unit < flyers, belief, tables, salt + np.uint64(unit), side)
            likely *= _UNSEEN if unit < flyers else 1.0
    return likely


@jit(inline=True)
def _recognise(world: int, cell: int, kind: int, taken: int, foe: int, last: int, bench: Bench, side: int) -> tuple[int, int]:
    """Return which unit of a world an enemy in sight is, the nearest of its type, best a living one; and how far off it was."""
    state, chosen, least = bench.now.state, -1, 1 << 30
    for unit in range(foe, last):
        if bench.tables.unit[unit, Trait.TYPE] == kind and not (taken >> unit) & 1:
            there = int(state.cell[world, unit])
            steps = max(abs(there // side - cell // side), abs(there % side - cell % side))
            steps += 0 if state.alive[world, unit] else 2 * side
            if steps < least:
                chosen, least = unit, steps
    return chosen, least


@jit(inline=True)
def _nearest_to_own(me: int, world: int, taken: int, foe: int, flyers: int, bench: Bench) -> tuple[int, int]:
    """Return the living enemy on foot, out of sight, that is nearest to a unit on foot of ours, or -1; and how near, squared."""
    state, tables = bench.now.state, bench.tables
    own, own_flyers, _ = units_of(me, tables)
    chosen, least = -1, 1 << 30
    for unit in range(foe, flyers):
        if not state.alive[world, unit] or (taken >> unit) & 1:
            continue
        chosen = unit if chosen < 0 else chosen
        for mine in range(own, own_flyers):  # the fallen, too: who fell stood in a fight
            down = tables.place[state.cell[world, unit], 0] - tables.place[state.cell[world, mine], 0]
            right = tables.place[state.cell[world, unit], 1] - tables.place[state.cell[world, mine], 1]
            if down * down + right * right < least:
                chosen, least = unit, int(down * down + right * right)
    return chosen, least


@jit()
def _elsewhere(cell: int, walks: bool, belief: Belief, tables: Tables, word: np.uint64, side: int) -> int:
    """Return a cell where a unit may be that is not where it was thought to be: near by, else anywhere."""
    turn = choose(word, 4)
    for away in range(1, 4):
        for k in range(4):
            to = cell
            for _ in range(away):
                to = int(tables.neighbour[1 + (k + turn) % 4, to])
            if _may_be(to, walks, belief, side):
                return to
    n_cells = side * side
    for attempt in range(_TRIES + n_cells):
        to = _try_cell(attempt, word, n_cells)
        if _may_be(to, walks, belief, side):
            return to
    return cell


@jit()
def _resample(me: int, mutates: int, bench: Bench, weights: Weights, seed: np.uint64) -> None:
    """Give the room of unlikely worlds to likely ones, at even steps; and let a few take another model."""
    now, then, likely, n = bench.now, bench.then, weights.likely, weights.likely.shape[0]
    total, least, most = 0.0, likely[0], likely[0]
    for world in range(n):
        total += likely[world]
        least, most = min(least, likely[world]), max(most, likely[world])
    if total > 0.0 and least < most:
        offset, before, source = choose(mix(seed), 1024) / 1024.0, 0.0, 0
        for world in range(n):
            while source < n - 1 and before + likely[source] * n / total <= world + offset:
                before += likely[source] * n / total
                source += 1
            weights.source[world] = source
        for world in range(n):
            copy_world(world, now, world, then)
        for world in range(n):
            copy_world(weights.source[world], then, world, now)
    for world in range(n):
        word = mix(seed + np.uint64(1 + world))
        if choose(word, mutates) == 0:
            now.model[world, 1 - me] = choose(mix(word), bench.rows.shape[0])
