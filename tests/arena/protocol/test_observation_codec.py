from collections.abc import Callable
from dataclasses import fields
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import SEEDS, rulesets, scatter

from arena.errors import UnreadableError
from arena.game.engine import BatchedGame
from arena.game.observation import FIELDS, Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.protocol.observation_codec import ObservationReader, ObservationWriter

PAPER = load("paper")
CLOCKS = st.none() | st.floats(0, 1e9, allow_nan=False) | st.just(inf)


def any_game(rules: Ruleset, seed: int) -> BatchedGame:
    games = BatchedGame(rules, 1)
    scatter(games, 0, np.random.default_rng(seed))
    return games


def assert_equal(one: Observations, other: Observations, n_cells: int) -> None:
    for field in fields(Observations):
        mine, theirs = getattr(one, field.name), getattr(other, field.name)
        if field.name == "ground":
            mine, theirs = mine[:, :n_cells], theirs[:, :n_cells]
        if isinstance(mine, np.ndarray):
            assert (mine.dtype, mine.shape) == (theirs.dtype, theirs.shape), field.name
            assert mine.tobytes() == theirs.tobytes(), field.name
        else:
            assert mine == theirs, field.name


@given(rulesets(max_side=24), SEEDS, CLOCKS)
def test_an_observation_comes_back_as_it_was(rules: Ruleset, seed: int, clock_s: float | None) -> None:
    games = any_game(rules, seed)

    for team, seen in games.observe().items():
        sight = ObservationWriter(seen, 0)
        if clock_s is not None:
            sight.set_clock(clock_s)
        back = ObservationReader(rules, team).read(sight.write())
        assert_equal(seen, back, rules.side**2)
        clock = back.seat(0, rules).clock_s
        assert repr(seen.seat(0, rules).units) == repr(back.seat(0, rules).units)
        if clock_s is None:
            assert clock is None
        else:
            assert clock is not None
            assert abs(clock - min(clock_s, 4_294_967.294)) <= 0.001


def test_observations_of_whole_games_come_back_as_they_were(size: Callable[[int, int], int]) -> None:
    rng = np.random.default_rng(5)
    for name in ("paper", "gym-cap", "exp1", "mirror"):
        rules = load(name)
        games = BatchedGame(rules, 3)
        for row in range(3):
            scatter(games, row, rng)
        for _ in range(size(30, 300)):
            for team, seen in games.observe().items():
                for row in range(3):
                    back = ObservationReader(rules, team).read(ObservationWriter(seen, row).write())
                    assert_equal(seen.select([row]), back, rules.side**2)
            games.step(rng.integers(-1, 6, (3, sum(games.n_units.values())), dtype=np.int8))


@given(rulesets(max_side=16), st.lists(SEEDS, min_size=2, max_size=6), CLOCKS)
def test_all_observations_under_one_ruleset_have_one_length(rules: Ruleset, seeds: list[int], clock_s: float | None) -> None:
    for team in Team:
        sights = [ObservationWriter(any_game(rules, seed).observe()[team], 0) for seed in seeds]
        lengths = {len(sight.write()) for sight in sights}
        if clock_s is not None:
            sights[0].set_clock(clock_s)
        assert lengths == {len(sights[0].write())}


def test_a_policy_may_write_to_what_it_is_shown() -> None:
    """As in the local venue; kernels are compiled for it."""
    seen = any_game(PAPER, 1).observe()[Team.RED]

    back = ObservationReader(PAPER, Team.RED).read(ObservationWriter(seen, 0).write())

    for field in fields(Observations):
        array = getattr(back, field.name)
        assert not isinstance(array, np.ndarray) or array.flags.writeable, field.name


def is_read_or_refused(data: bytes, rules: Ruleset, team: Team) -> None:
    """Unpack, let nothing but `UnreadableError` pass, and check that what is read can be used."""
    try:
        seen = ObservationReader(rules, team).read(data)
    except UnreadableError:
        return
    seat = seen.seat(0, rules)
    assert seat.grid.shape == (rules.side, rules.side)
    assert seat.legal_actions.shape == (len(seat.units), 5)


@given(rulesets(max_side=12), SEEDS, st.sampled_from(Team), st.data())
def test_changed_bytes_are_an_observation_or_unreadable(rules: Ruleset, seed: int, team: Team, data: st.DataObject) -> None:
    changed = bytearray(ObservationWriter(any_game(rules, seed).observe()[team], 0).write())
    for _ in range(data.draw(st.integers(1, 5))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))

    is_read_or_refused(bytes(changed), rules, team)


@given(st.binary(max_size=600), st.sampled_from(Team))
def test_random_bytes_are_unreadable(data: bytes, team: Team) -> None:
    with pytest.raises(UnreadableError):
        ObservationReader(PAPER, team).read(data)


@given(SEEDS)
def test_random_bytes_of_the_right_length_are_unreadable(seed: int) -> None:
    length = len(ObservationWriter(any_game(PAPER, 1).observe()[Team.BLUE], 0).write())

    is_read_or_refused(np.random.default_rng(seed).bytes(length), PAPER, Team.BLUE)


@pytest.mark.parametrize("change", [-1, 1])
def test_another_length_is_refused_with_both(change: int) -> None:
    data = ObservationWriter(any_game(PAPER, 1).observe()[Team.BLUE], 0).write()
    other = data[:change] if change < 0 else data + b"\0"

    with pytest.raises(UnreadableError, match=f"an observation has {len(data)} bytes under these rules, not {len(other)}"):
        ObservationReader(PAPER, Team.BLUE).read(other)


BOUNDED = [name for name, spec in FIELDS.items() if spec.is_on_wire and spec.values is not None]


@pytest.mark.parametrize("name", BOUNDED)
@pytest.mark.parametrize("team", Team)
def test_a_value_that_no_game_has_is_refused(name: str, team: Team) -> None:
    spec, seen = FIELDS[name], any_game(PAPER, 1).observe()[team]
    values = spec.values_of(PAPER, team)
    assert values is not None
    for value in (values[-1] + 1, *([values[0] - 1] if np.iinfo(spec.dtype).min < 0 else [])):
        getattr(seen, name).reshape(1, -1)[0, 0] = value

        with pytest.raises(UnreadableError, match="no game has"):
            ObservationReader(PAPER, team).read(ObservationWriter(seen, 0).write())


@pytest.mark.parametrize("name", ["enemy_cell", "enemy_type"])
def test_an_enemy_with_a_type_and_no_place_or_the_other_way_round_is_refused(name: str) -> None:
    seen = Observations.blank(PAPER, Team.BLUE, 1)
    getattr(seen, name)[0, 0] = 0

    with pytest.raises(UnreadableError, match="an enemy with a type and no place, or a place and no type"):
        ObservationReader(PAPER, Team.BLUE).read(ObservationWriter(seen, 0).write())


@given(rulesets(max_side=24), st.sampled_from(Team))
def test_every_field_is_aligned_in_the_bytes(rules: Ruleset, team: Team) -> None:
    seen = ObservationReader(rules, team).blank()

    assert all(getattr(seen, name).flags.aligned for name in FIELDS)
