"""What a seat believes: the ground, where the flags may lie, where each enemy on foot may be, and how far all that is.

Everything follows from the observations of one seat, in their order: `update` is the only way in. Arrays have a leading axis
of seats, sets of cells are rows of bits (`policies.belief.bitrows`), and all memory belongs to the caller:

    belief, known = make_belief(ruleset, team, n_seats), know(ruleset, team)    # once
    forget(belief, seats)                                                   # when matches begin there
    update(sight_of(observations), belief, known)                           # once a tick; then read `belief`
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import can_enter
from arena.game.rules import reach_of
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team
from arena.jit import jit
from policies.belief.bitrows import NONE, bit, count, flood, low_bits
from policies.belief.memory import remember
from policies.belief.tracks import track

NEVER = -1
"""Stands in `Belief.seen_at` where nobody has looked yet."""


class Known(NamedTuple):
    """What a team knows before the first tick: the rules, and which codes of a cell are its own."""

    side: int
    tick_limit: int
    is_combat_random: bool
    self_counts: bool
    flies: NDArray[np.uint8]
    """Shape (own units,)."""
    step: NDArray[np.int64]
    """Shape (own units,): cells per tick."""
    sight_cells: NDArray[np.int64]
    """Shape (own units,)."""
    reach: NDArray[np.int64]
    """Shape (own units,): greatest squared distance at which it hits; -1 for none."""
    strength: NDArray[np.int64]
    """Shape (own units,)."""
    type_reach: NDArray[np.int64]
    """Shape (unit types,): as `reach`, by `Observations.enemy_type`."""
    type_strength: NDArray[np.int64]
    """Shape (unit types,)."""
    type_step: NDArray[np.int64]
    """Shape (unit types,)."""
    n_enemy_walkers: int
    n_enemy_flyers: int
    """They cannot be hit, so the rest of the enemy's living are those on foot."""
    enemy_step: int
    """The most cells that an enemy on foot goes in a tick."""
    own_half: int
    """Code of a cell, as the three that follow."""
    enemy_half: int
    own_flag: int
    enemy_flag: int


class Belief(NamedTuple):
    """What is believed, in caller-owned memory."""

    tick: NDArray[np.int32]
    """Shape (seats,): tick of the last update, -1 before the first."""
    ground: NDArray[np.int8]
    """Shape (seats, cells): codes of the ground as last seen, HIDDEN where never seen."""
    seen_at: NDArray[np.int16]
    """Shape (seats, cells): tick at which a cell was last in sight, or NEVER."""
    forward: NDArray[np.int8]
    """Shape (seats,): 1 where the enemy's half is the eastern one, -1 where it is the western."""
    own_flag: NDArray[np.int16]
    """Shape (seats,): its cell, -1 until seen."""
    enemy_flag: NDArray[np.int16]
    """Shape (seats,)."""
    in_sight: NDArray[np.uint64]
    """Shape (seats, side): the cells in sight now."""
    walkable: NDArray[np.uint64]
    """Shape (seats, side): every cell that is not known as an obstacle."""
    enemy_half: NDArray[np.uint64]
    """Shape (seats, side): the enemy's half, as far as `forward` tells and what was seen corrects."""
    flag_rows: NDArray[np.uint64]
    """Shape (seats, side): where the enemy's flag may lie. The posterior is uniform: 1 / n_flag_cells on each."""
    home_rows: NDArray[np.uint64]
    """Shape (seats, side): where the own flag may lie."""
    n_flag_cells: NDArray[np.int16]
    """Shape (seats,): cells in `flag_rows`; 1 once the flag is seen."""
    enemy_rows: NDArray[np.uint64]
    """Shape (seats, enemy walkers, side): where each enemy on foot may be. Which track is which enemy nobody knows: there is
    always a way to give each living enemy a track of its own that contains it. Empty for a fallen one."""
    enemy_cell: NDArray[np.int16]
    """Shape (seats, enemy walkers): where it stands in sight, `tracks.HIDDEN_NOW` or `tracks.FALLEN`."""
    n_enemies: NDArray[np.int16]
    """Shape (seats,): living enemies on foot."""
    to_flag: NDArray[np.int16]
    """Shape (seats, cells): steps on foot to the nearest cell of `flag_rows`; UNREACHED where no way leads."""
    to_home: NDArray[np.int16]
    """Shape (seats, cells): steps on foot to the nearest cell of `home_rows`."""
    work: NDArray[np.uint64]
    """Shape (17, 64): scratch."""


def know(ruleset: Ruleset, team: Team) -> Known:
    """Return what `team` knows of a ruleset."""
    own, enemies = ruleset.team(team), ruleset.team(team.other)
    reach = {unit.name: reach_of(unit.attack, ruleset.attack_at_range, unit.flies) for unit in ruleset.units}

    def numbers(values: Any) -> NDArray[np.int64]:
        return np.array(list(values), np.int64)

    return Known(
        side=ruleset.side,
        tick_limit=ruleset.tick_limit,
        is_combat_random=ruleset.random_combat,
        self_counts=ruleset.self_counts,
        flies=np.array([unit.flies for unit in own], np.uint8),
        step=numbers(unit.step for unit in own),
        sight_cells=numbers(unit.sight for unit in own),
        reach=numbers(reach[unit.name] for unit in own),
        strength=numbers(unit.strength for unit in own),
        type_reach=numbers(reach[unit.name] for unit in ruleset.units),
        type_strength=numbers(unit.strength for unit in ruleset.units),
        type_step=numbers(unit.step for unit in ruleset.units),
        n_enemy_walkers=sum(not unit.flies for unit in enemies),
        n_enemy_flyers=sum(unit.flies for unit in enemies),
        enemy_step=max((unit.step for unit in enemies if not unit.flies), default=0),
        own_half=int(HALVES[team]), enemy_half=int(HALVES[team.other]),
        own_flag=int(FLAGS[team]), enemy_flag=int(FLAGS[team.other]),
    )  # fmt: skip


def make_belief(ruleset: Ruleset, team: Team, n_seats: int) -> Belief:
    """Return memory for the beliefs of some seats, which know nothing yet."""
    side, n_walkers = ruleset.side, sum(not unit.flies for unit in ruleset.team(team.other))

    def rows(*shape: int) -> NDArray[np.uint64]:
        return np.zeros((n_seats, *shape, side), np.uint64)

    belief = Belief(
        tick=np.zeros(n_seats, np.int32),
        ground=np.zeros((n_seats, side**2), np.int8),
        seen_at=np.zeros((n_seats, side**2), np.int16),
        forward=np.zeros(n_seats, np.int8),
        own_flag=np.zeros(n_seats, np.int16),
        enemy_flag=np.zeros(n_seats, np.int16),
        in_sight=rows(),
        walkable=rows(),
        enemy_half=rows(),
        flag_rows=rows(),
        home_rows=rows(),
        n_flag_cells=np.zeros(n_seats, np.int16),
        enemy_rows=rows(n_walkers),
        enemy_cell=np.zeros((n_seats, n_walkers), np.int16),
        n_enemies=np.zeros(n_seats, np.int16),
        to_flag=np.zeros((n_seats, side**2), np.int16),
        to_home=np.zeros((n_seats, side**2), np.int16),
        work=np.zeros((17, 64), np.uint64),
    )
    forget(belief, np.arange(n_seats))
    return belief


def forget(belief: Belief, seats: NDArray[np.intp]) -> None:
    """Make some seats know nothing; the first update after it sets all that is not set here."""
    belief.tick[seats] = -1
    belief.ground[seats] = Code.HIDDEN
    belief.seen_at[seats] = NEVER
    belief.forward[seats] = 0
    belief.own_flag[seats] = -1
    belief.enemy_flag[seats] = -1


@jit()
def update(sight: Any, belief: Any, known: Any) -> None:
    """Take in one observation of every seat.

    Parameters
    ----------
    sight
        A `memory.Sight` of as many seats as `belief`.
    """
    for seat in range(sight.tick.shape[0]):
        update_seat(seat, sight, belief, known)


@jit()
def update_seat(seat: int, sight: Any, belief: Any, known: Any) -> None:
    """Take in one observation of one seat."""
    side, is_first = known.side, belief.tick[seat] < 0
    knew_flag, knew_home = belief.enemy_flag[seat] >= 0, belief.own_flag[seat] >= 0
    is_new = remember(seat, sight, belief, known)
    if is_first:
        _assume(seat, belief, known)
    _look(seat, sight, belief, side)
    if is_new or is_first or not knew_flag:
        _narrow(seat, belief.flag_rows, belief.enemy_flag, belief, side)
        belief.n_flag_cells[seat] = count(belief.flag_rows[seat], side)
        flood(belief.flag_rows[seat], belief.walkable[seat], belief.in_sight[seat], 0, side, belief.work, belief.to_flag[seat])
    if is_new or is_first or not knew_home:
        _narrow(seat, belief.home_rows, belief.own_flag, belief, side)
        flood(belief.home_rows[seat], belief.walkable[seat], belief.in_sight[seat], 0, side, belief.work, belief.to_home[seat])
    track(seat, sight, belief, known, is_first)
    belief.tick[seat] = sight.tick[seat]


@jit()
def _assume(seat: int, belief: Any, known: Any) -> None:
    """Set what is believed before anything is seen: the flag of each team lies somewhere on its half."""
    side = known.side
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
def _look(seat: int, sight: Any, belief: Any, side: int) -> None:
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
def _narrow(seat: int, rows: Any, flag: Any, belief: Any, side: int) -> None:
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
