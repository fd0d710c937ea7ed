"""What a seat believes: the ground, where the flags may lie, where each enemy on foot may be, and how far all that is.

Everything follows from the observations of one seat, in their order: `policies.belief.update` is the only way in. Arrays have a
leading axis of seats, sets of cells are rows of bits (`policies.belief.bitrows`), and all memory belongs to the caller:

    belief, rules = make_belief(ruleset, team, n_seats), team_rules(ruleset, team)    # once
    forget(belief, seats)                                                             # when matches begin there
    update(sight_of(observations), belief, rules)                                     # once a tick; then read `belief`
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.types import Code, Team

NEVER = -1
"""Value of `Belief.seen_at` for a cell that was never in sight."""
HIDDEN_NOW, FALLEN = -1, -2
"""Values of `Belief.enemy_cell` for an enemy out of sight, and for one that is dead."""


class Belief(NamedTuple):
    """What some seats believe, in memory of the caller."""

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
    """Shape (seats, enemy walkers): where it stands in sight, HIDDEN_NOW or FALLEN."""
    n_enemies: NDArray[np.int16]
    """Shape (seats,): living enemies on foot."""
    to_flag: NDArray[np.int16]
    """Shape (seats, cells): steps on foot to the nearest cell of `flag_rows`; UNREACHED where no way leads."""
    to_home: NDArray[np.int16]
    """Shape (seats, cells): steps on foot to the nearest cell of `home_rows`."""
    work: NDArray[np.uint64]
    """Shape (17, 64): scratch."""


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
