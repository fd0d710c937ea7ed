"""The law of the fog: two states that agree in what a team may know give it the same observation, to the byte.

`another_truth` moves all that is hidden. The property is then tried on leaks, one through each field, and must catch every one.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import oracle
import pytest
from hypothesis import given
from lookalikes import another_truth
from worlds import SEEDS, bytes_of, lay, rules_for, rulesets, scatter, to_match

from arena.game.engine import BatchedGame
from arena.game.observation import FIELDS, EnemyUnit, Observation, Observations
from arena.game.ruleset import Ruleset, UnitType, load
from arena.game.state import StateField
from arena.game.types import Code, Team, Termination
from arena.protocol.observation_codec import ObservationWriter

Look = Callable[[BatchedGame, Team], tuple[Observations, Observation]]
"""What one team is told of row 0, as a batch sees it and as a bot does."""


def look(games: BatchedGame, team: Team) -> tuple[Observations, Observation]:
    batch = games.observe()[team]
    return batch.select([0]), batch.seat(0, games.ruleset)


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
