"""The law of the fog: two states that agree in what a team may know give it the same observation, to the byte.

`another_truth` moves all that is hidden. The property is then tried on leaks, one through each field, and must catch every one.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
import oracle
import pytest
from hypothesis import given
from worlds import SEEDS, bytes_of, copy_of, lay, rules_for, rulesets, scatter, to_match

from arena.game.engine import BatchedGame
from arena.game.observation import FIELDS, EnemyUnit, Observation, Observations
from arena.game.ruleset import Ruleset, UnitType, load
from arena.game.state import StateField
from arena.game.types import FLAGS, HALVES, Code, Team, Termination
from arena.protocol.observation_codec import ObservationWriter

Look = Callable[[BatchedGame, Team], tuple[Observations, Observation]]
"""What one team is told of row 0, as a batch sees it and as a bot does."""


def look(games: BatchedGame, team: Team) -> tuple[Observations, Observation]:
    batch = games.observe()[team]
    return batch.select([0]), batch.seat(0, games.ruleset)


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


def assert_same(one: tuple[Observations, Observation], other: tuple[Observations, Observation], n_cells: int) -> None:
    """Compare every field there is, by its bytes, and all that is computed from them."""
    for field in fields(Observations):
        mine, theirs = (getattr(batch, field.name) for batch, _ in (one, other))
        if field.name == "ground":
            mine, theirs = mine[:, :n_cells], theirs[:, :n_cells]
        assert np.asarray(mine).tobytes() == np.asarray(theirs).tobytes(), f"Observations.{field.name}"
    for field in fields(Observation):
        mine, theirs = (getattr(seat, field.name) for _, seat in (one, other))
        if isinstance(mine, np.ndarray):
            mine, theirs = mine.tobytes(), theirs.tobytes()
        assert repr(mine) == repr(theirs), f"Observation.{field.name}"
    for name in ("grid", "legal_actions"):
        assert getattr(one[1], name).tobytes() == getattr(other[1], name).tobytes(), name
    assert one[1].rng.bytes(8) == other[1].rng.bytes(8)


def any_state(rules: Ruleset, seed: int) -> tuple[BatchedGame, Team, np.random.Generator]:
    rng = np.random.default_rng(seed)
    games = BatchedGame(rules, 1)
    scatter(games, 0, rng, fallen=float(rng.choice([0.0, 0.3])))
    games._seat_keys[:] = rng.integers(0, 2**32, games._seat_keys.shape, dtype=np.uint32)
    return games, Team(int(rng.integers(2))), rng


def foggy(rng: np.random.Generator) -> Ruleset:
    """Return a ruleset under which most states hide somebody, and show somebody."""
    n = rng.integers(2, 6, 6).tolist()
    units = (
        UnitType(name="foot", step=1, sight=int(rng.integers(1, 3)), attack=2, blue=n[0], red=n[1]),
        UnitType(name="guard", step=0, sight=1, attack=1, blue=n[2] - 2, red=n[3] - 2),
        UnitType(name="eye", step=3, sight=int(rng.integers(1, 4)), flies=True, blue=n[4] - 2, red=n[5] - 2),
    )
    return Ruleset(name="foggy", side=int(rng.choice([8, 10, 12, 20])), units=units)


def check_the_law(see: Look, n_cases: int) -> Counter[str]:
    """Assert the law over many cases; return how many of them really changed what."""
    happened: Counter[str] = Counter()
    rng = np.random.default_rng(11)
    for _ in range(n_cases):
        games, team, own_rng = any_state(foggy(rng), int(rng.integers(2**32)))
        moved = another_truth(games, team, own_rng)
        assert_same(see(games, team), see(moved.games, team), games.ruleset.side**2)
        happened.update(moved.kinds)
    return happened


def test_what_is_hidden_does_not_change_the_observation(size: Callable[[int, int], int]) -> None:
    n = size(400, 10_000)

    happened = check_the_law(look, n)

    assert happened["a hidden enemy"] >= n / 2
    assert happened["a hidden flag"] >= n / 2
    assert happened["a hidden cell"] >= n / 2
    assert happened["who has fallen"] >= n / 10


@given(rulesets(max_side=24), SEEDS)
def test_what_is_hidden_does_not_change_the_observation_under_any_rules(rules: Ruleset, seed: int) -> None:
    games, team, rng = any_state(rules, seed)

    other = another_truth(games, team, rng).games

    assert_same(look(games, team), look(other, team), rules.side**2)
    assert games.grids()[team].tobytes() == other.grids()[team].tobytes()


@given(rulesets(max_side=24), SEEDS)
def test_what_is_hidden_does_not_change_the_bytes_on_the_wire(rules: Ruleset, seed: int) -> None:
    games, team, rng = any_state(rules, seed)

    other = another_truth(games, team, rng).games

    packed = [ObservationWriter(truth.observe()[team], 0).write() for truth in (games, other)]
    assert packed[0] == packed[1]


def test_an_observation_depends_on_its_own_row_alone() -> None:
    games = BatchedGame(load("paper"), 3)
    rng = np.random.default_rng(2)
    for row in range(3):
        scatter(games, row, rng)
    before = [games.observe()[team].select([1]).seat(0, games.ruleset) for team in Team]
    for row in (0, 2):
        scatter(games, row, rng)

    after = [games.observe()[team].select([1]).seat(0, games.ruleset) for team in Team]

    for mine, theirs in zip(before, after, strict=True):
        assert mine.grid.tobytes() == theirs.grid.tobytes()
        assert [mine.units, mine.enemies, mine.seed] == [theirs.units, theirs.enemies, theirs.seed]


# Leaks, one through each field


def secret(games: BatchedGame, team: Team) -> int:
    """Return a number that depends on what is hidden from a team: where its living enemies stand."""
    first = games.n_units[Team.BLUE] if team is Team.BLUE else 0
    theirs = slice(first, first + games.n_units[team.other])
    return int((games.state.cell[0, theirs] * games.state.alive[0, theirs]).sum())


def hidden_enemy(games: BatchedGame, team: Team) -> tuple[int, int, UnitType] | None:
    """Return (row, column, type) of the first living enemy out of sight."""
    match = to_match(games, 0)
    seen = oracle.sight(match, team)
    unseen = (u for u in match.units if u.team is team.other and u.alive and u.cell not in seen)
    return next(((*unit.cell, unit.kind) for unit in unseen), None)


def leak_ground(games: BatchedGame, team: Team, batch: Observations, seat: Observation) -> np.ndarray:
    """Show the first hidden cell as it is."""
    ground = seat.ground.copy()
    hidden = np.argwhere(ground == Code.HIDDEN)
    if len(hidden):
        row, column = hidden[0]
        ground[row, column] = games.state.ground[0, row * games.ruleset.side + column]
    return ground


def leak_an_enemy(games: BatchedGame, team: Team, batch: Observations, seat: Observation) -> tuple[EnemyUnit, ...]:
    found = hidden_enemy(games, team)
    if found is None:
        return seat.enemies
    row, column, kind = found
    return tuple(sorted((*seat.enemies, EnemyUnit(row=row, column=column, type=kind.name, flies=kind.flies))))


def leak_a_number(field: str) -> "SeatLeak":
    """Add a secret to a number, or to the last of several."""

    def leak(games: BatchedGame, team: Team, batch: Observations, seat: Observation) -> int | tuple[int, ...]:
        value, more = getattr(seat, field), secret(games, team) % 2
        return (*value[:-1], value[-1] + more) if isinstance(value, tuple) else value + more

    return leak


def by_index(games: BatchedGame, team: Team, batch: Observations, seat: Observation) -> tuple[EnemyUnit, ...]:
    """List the enemies in sight in the order of their indices, which no team may know."""
    side, kinds = games.ruleset.side, games.ruleset.team(team.other)
    first = games.n_units[Team.BLUE] if team is Team.BLUE else 0
    spotted = {(enemy.row, enemy.column, enemy.type) for enemy in seat.enemies}
    listed = []
    for index, kind in enumerate(kinds):
        row, column = divmod(int(games.state.cell[0, first + index]), side)
        if games.state.alive[0, first + index] and (row, column, kind.name) in spotted:
            listed.append(EnemyUnit(row=row, column=column, type=kind.name, flies=kind.flies))
    return tuple(listed)


SeatLeak = Callable[[BatchedGame, Team, Observations, Observation], object]
NUMBERS = FIELDS.keys() & {field.name for field in fields(Observation)} - {"ground"}
SEAT_LEAKS: dict[str, SeatLeak] = {name: leak_a_number(name) for name in sorted(NUMBERS)} | {
    "team": lambda games, team, batch, seat: Team(secret(games, team) % 2),
    "ground": leak_ground,
    "units": lambda games, team, batch, seat: tuple(replace(u, alive=bool(secret(games, team) % 2)) for u in seat.units),
    "enemies": leak_an_enemy,
    "enemies, by index": by_index,
    "clock_s": lambda games, team, batch, seat: float(secret(games, team)),
    "seed, of the enemy's fights": lambda games, team, batch, seat: (
        seat.seed ^ int(games.state.key[0, oracle.FIGHT, team.other, 0])
    ),
    "seed, of the own fights": lambda games, team, batch, seat: seat.seed ^ int(games.state.key[0, oracle.FIGHT, team, 0]),
    "seed, of the enemy": lambda games, team, batch, seat: seat.seed ^ int(games._seat_keys[team.other, 0, 0]),
}


@pytest.mark.parametrize("name", SEAT_LEAKS)
def test_the_law_catches_a_leak_through(name: str) -> None:
    def leaky(games: BatchedGame, team: Team) -> tuple[Observations, Observation]:
        batch, seat = look(games, team)
        return batch, replace(seat, **{field: SEAT_LEAKS[name](games, team, batch, seat)})

    field = name.partition(",")[0]
    with pytest.raises(AssertionError, match=rf"Observation\.{field}"):
        check_the_law(leaky, 50)


def add_secret(field: str) -> Callable[[BatchedGame, Team, Observations], np.ndarray]:
    def leak(games: BatchedGame, team: Team, batch: Observations) -> np.ndarray:
        array = np.array(getattr(batch, field))
        array.ravel()[: games.ruleset.side**2][-1:] += np.asarray(secret(games, team) % 2).astype(array.dtype)
        return array

    return leak


BATCH_FIELDS = [field.name for field in fields(Observations)]


@pytest.mark.parametrize("field", BATCH_FIELDS)
def test_the_law_catches_a_leak_through_the_batch_too(field: str) -> None:
    def leaky(games: BatchedGame, team: Team) -> tuple[Observations, Observation]:
        batch, seat = look(games, team)
        value = {
            "team": lambda: Team(secret(games, team) % 2),
            "side": lambda: batch.side + secret(games, team) % 2,
        }.get(field, lambda: add_secret(field)(games, team, batch))()
        return replace(batch, **{field: value}), seat

    with pytest.raises(AssertionError, match=rf"Observations\.{field}"):
        check_the_law(leaky, 50)


def test_every_field_has_a_leak() -> None:
    assert {name.partition(",")[0] for name in SEAT_LEAKS} == {field.name for field in fields(Observation)} - {"annotations"}


def test_looking_changes_nothing() -> None:
    games, _, _ = any_state(load("paper"), 3)
    before = bytes_of(games)

    games.observe()
    games.grids()
    games.truth(0)

    assert bytes_of(games) == before


# What is seen, drawn as text: ? is hidden


def view(board: str, team: Team, **overrides: object) -> str:
    letters = {-1: "?", 0: ".", 1: ".", 2: "U", 3: "A", 4: "u", 5: "a", 6: "F", 7: "f", 8: "#"}
    grid = lay(rules_for(board, **overrides)).grids()[team, 0]
    return "\n".join(" ".join(letters[code] for code in row) for row in grid.tolist())


FIELD = """\
F . . . . . . .
. . . . . . . .
. . . # . . . .
. . U # u . . .
. . . # . . . .
. . . . . . . .
. . . . . . A .
u . . . . . . f"""


def test_sight_is_a_disc_through_everything() -> None:
    blind = {"uav": {"sight": 0}}

    assert view(FIELD, Team.BLUE, ugv={"sight": 2}, **blind) == (
        "? ? ? ? ? ? ? ?\n"
        "? ? . ? ? ? ? ?\n"
        "? . . # ? ? ? ?\n"
        ". . U # u ? ? ?\n"
        "? . . # ? ? ? ?\n"
        "? ? . ? ? ? ? ?\n"
        "? ? ? ? ? ? A ?\n"
        "? ? ? ? ? ? ? ?"
    )


def test_sight_is_the_union_over_units_and_each_has_its_own() -> None:
    assert view(FIELD, Team.BLUE, ugv={"sight": 1}, uav={"sight": 2}) == (
        "? ? ? ? ? ? ? ?\n"
        "? ? ? ? ? ? ? ?\n"
        "? ? . ? ? ? ? ?\n"
        "? . U # ? ? ? ?\n"
        "? ? . ? ? ? . ?\n"
        "? ? ? ? ? . . .\n"
        "? ? ? ? . . A .\n"
        "? ? ? ? ? . . f"
    )


def test_the_other_team_sees_by_its_own_units() -> None:
    assert view(FIELD, Team.RED, ugv={"sight": 1}) == (
        "? ? ? ? ? ? ? ?\n"
        "? ? ? ? ? ? ? ?\n"
        "? ? ? ? . ? ? ?\n"
        "? ? ? # u . ? ?\n"
        "? ? ? ? . ? ? ?\n"
        "? ? ? ? ? ? ? ?\n"
        ". ? ? ? ? ? ? ?\n"
        "u . ? ? ? ? ? ?"
    )


def test_without_fog_all_is_seen_even_by_nobody() -> None:
    games = lay(rules_for(FIELD, fog=False))
    games.state.alive[0] = 0

    assert (games.grids() == games.state.ground[0, :64].reshape(8, 8)).all()
    assert view(FIELD, Team.RED, fog=False) == FIELD


def test_the_fallen_see_nothing_and_are_not_seen() -> None:
    games = lay(rules_for("F . . .\nU . . .\n. u . .\n. . . f", ugv={"sight": 9}))
    games.state.alive[0] = [0, 1]

    grids = games.grids()[:, 0]

    assert (grids[Team.BLUE] == Code.HIDDEN).all()
    assert grids[Team.RED, 1, 0] == Code.BLUE_HALF
    assert games.observe()[Team.RED].seat(0, games.ruleset).enemies == ()


def test_a_walker_hides_a_uav_which_hides_a_flag_and_an_own_uav_an_enemys() -> None:
    games = lay(rules_for("F . # .\nU A . u\n. a . .\n. . . f", uav={"sight": 9}))
    blue_uav, red_uav = 1, 3

    def stack(blue: int, red: int) -> tuple[int, int]:
        """Show what each team sees in the cell of the first UAV when the two fly over some cells."""
        games.state.cell[0, [blue_uav, red_uav]] = blue, red
        grids = games.grids()[:, 0].reshape(2, 16)
        return int(grids[Team.BLUE, blue]), int(grids[Team.RED, blue])

    assert stack(4, 4) == (Code.BLUE_UGV, Code.BLUE_UGV)
    assert stack(7, 7) == (Code.RED_UGV, Code.RED_UGV)
    assert stack(9, 9) == (Code.BLUE_UAV, Code.RED_UAV)
    assert stack(0, 5) == (Code.BLUE_UAV, Code.BLUE_UAV)
    assert stack(15, 15) == (Code.BLUE_UAV, Code.RED_UAV)
    assert stack(2, 2) == (Code.BLUE_UAV, Code.RED_UAV)


def test_enemies_in_one_cell_are_listed_by_type_whatever_their_index() -> None:
    kinds = (
        UnitType(name="low", step=1, sight=9, flies=True, blue=1, red=1),
        UnitType(name="high", step=1, sight=9, flies=True, blue=1, red=2),
    )
    games = BatchedGame(Ruleset(name="sky", side=4, units=kinds), 1)
    scatter(games, 0, np.random.default_rng(0), n_obstacles=0)
    games.state.cell[0] = [0, 1, 6, 6, 5]

    spotted = games.observe()[Team.BLUE].seat(0, games.ruleset).enemies

    assert [(enemy.row, enemy.column, enemy.type) for enemy in spotted] == [(1, 1, "high"), (1, 2, "low"), (1, 2, "high")]


def test_a_seat_keeps_what_it_was_told_when_the_game_goes_on() -> None:
    games = lay(rules_for("F . . .\nU . u .\n. . . .\n. . . f", ugv={"attack": 0, "sight": 9}))
    told = games.observe()[Team.BLUE].seat(0, games.ruleset)
    ground = told.ground.tobytes()

    games.step(np.array([[2, 3]], np.int8))
    games.observe()

    assert (told.units[0].row, told.units[0].column, told.enemies[0].column) == (1, 0, 2)
    assert told.ground.tobytes() == ground
    assert told.ground.base is None
    assert not told.ground.flags.writeable
    assert games.state.field[0, StateField.ENDING] == Termination.RUNNING
