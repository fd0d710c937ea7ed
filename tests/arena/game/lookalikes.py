"""Another state that looks the same to one team: all that is hidden from it is changed, and what it may know is not."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import oracle
from worlds import copy_of, to_match

from arena.game.engine import BatchedGame
from arena.game.observation import FIELDS
from arena.game.state import StateField
from arena.game.types import FLAGS, HALVES, Code, Team


@dataclass
class Moved:
    """What differs between two truths of which one team cannot tell which is the case."""

    games: BatchedGame
    kinds: Counter[str]


def another_truth(games: BatchedGame, team: Team, rng: np.random.Generator) -> Moved:
    """Return another state of row 0 that agrees in the team's own units, the cells in its sight, and the public facts.

    Changed are: where hidden enemies stand, and which have fallen; every hidden cell, flags included; where the fallen lie;
    which index an enemy in sight has; all keys; and what earlier games left in memory.
    """
    other, kinds = copy_of(games), Counter[str]()
    state, rules, side = other.state, games.ruleset, games.ruleset.side
    seen = {row * side + column for row, column in oracle.sight(to_match(games, 0), team)}
    hidden = np.array([cell for cell in range(side * side) if cell not in seen], int)
    first = games.n_units[Team.BLUE] if team is Team.BLUE else 0
    enemies = np.arange(first, first + games.n_units[team.other])
    flies = np.array([unit.flies for unit in rules.team(team.other)], bool)
    types = np.array([rules.units.index(unit) for unit in rules.team(team.other)], int)
    in_sight = np.array([state.alive[0, enemy] and int(state.cell[0, enemy]) in seen for enemy in enemies], bool)

    unseen = enemies[~in_sight & ~flies]
    state.alive[0, unseen] = rng.permutation(state.alive[0, unseen])
    shake_ground(other, team, hidden, rng)
    free = hidden[state.ground[0, hidden] != Code.OBSTACLE]
    walkers = unseen[state.alive[0, unseen] == 1]
    state.cell[0, walkers] = rng.permutation(free)[: len(walkers)]
    if len(hidden):
        flyers = enemies[~in_sight & flies]
        state.cell[0, flyers] = rng.choice(hidden, len(flyers))
    fallen = enemies[state.alive[0, enemies] == 0]
    state.cell[0, fallen] = rng.integers(0, side * side, len(fallen))
    for kind in set(types.tolist()):
        alike = enemies[types == kind]
        shuffled = rng.permutation(alike)
        state.cell[0, alike], state.alive[0, alike] = state.cell[0, shuffled], state.alive[0, shuffled]

    spare = rng.integers(0, 2**32, state.key.shape, dtype=np.uint32)
    state.key[:] = spare
    state.event[:] = rng.integers(-1, 9, state.event.shape)
    other._seat_keys[team.other] = rng.integers(0, 2**32, other._seat_keys[team.other].shape, dtype=np.uint32)
    state.field[0, StateField.WINNER] = rng.integers(-1, 2)
    spoil_memory(other, rng)

    was, now = games.state, other.state
    hidden_before = {int(cell) for cell in was.cell[0, enemies[~in_sight]][was.alive[0, enemies[~in_sight]] == 1]}
    living_now = {int(cell) for cell in now.cell[0, enemies][now.alive[0, enemies] == 1]} - seen
    kinds["a hidden enemy"] += hidden_before != living_now
    kinds["a hidden flag"] += any(
        was.field[0, flag] != now.field[0, flag] for flag in (StateField.BLUE_FLAG, StateField.RED_FLAG)
    )
    kinds["a hidden cell"] += bool((was.ground[0] != now.ground[0]).any())
    kinds["who has fallen"] += bool((was.alive[0] != now.alive[0]).any())
    kinds["an index in sight"] += sorted(was.cell[0, enemies[in_sight]].tolist()) != sorted(
        now.cell[0, enemies[in_sight]].tolist()
    )
    assert_agree(games, other, team)
    return Moved(other, kinds)


def shake_ground(games: BatchedGame, team: Team, hidden: np.ndarray, rng: np.random.Generator) -> None:
    """Draw every hidden cell anew: flags that were hidden stay hidden, and enough land is left to stand on."""
    state = games.state
    hidden_flags = [flag for flag in Team if int(state.field[0, StateField.BLUE_FLAG + flag]) in hidden]
    codes = rng.choice([*HALVES, *HALVES, Code.OBSTACLE], len(hidden)).astype(np.int8)
    places = rng.permutation(len(hidden))
    n_land = len(hidden_flags) + games.n_units[team.other]
    codes[places[:n_land]] = rng.choice(HALVES, len(places[:n_land]))
    for flag, place in zip(hidden_flags, places, strict=False):
        codes[place] = FLAGS[flag]
        state.field[0, StateField.BLUE_FLAG + flag] = hidden[place]
    state.ground[0, hidden] = codes


def spoil_memory(games: BatchedGame, rng: np.random.Generator) -> None:
    """Leave what another game might have left in the memory that observations are written to."""
    games._boards[:] = rng.integers(-1, 9, games._boards.shape)
    games._rows[:] = rng.integers(0, 2**63, games._rows.shape)
    for seen in games._seen.values():
        for name in (name for name, spec in FIELDS.items() if spec.is_of_kernel):
            array = getattr(seen, name)
            array[:] = rng.integers(0, 100, array.shape)


def assert_agree(one: BatchedGame, other: BatchedGame, team: Team) -> None:
    """The premise, as the oracle sees it: own units, cells in sight with what is on them, public facts."""
    mine, theirs = to_match(one, 0), to_match(other, 0)
    own = [[(u.index, u.cell, u.alive) for u in match.units if u.team is team] for match in (mine, theirs)]
    assert own[0] == own[1]
    assert oracle.sight(mine, team) == oracle.sight(theirs, team)
    assert oracle.ground_seen(mine, team) == oracle.ground_seen(theirs, team)
    assert oracle.enemies_seen(mine, team) == oracle.enemies_seen(theirs, team)
    assert (mine.tick, mine.score) == (theirs.tick, theirs.score)
    assert [mine.living(t) for t in Team] == [theirs.living(t) for t in Team]
