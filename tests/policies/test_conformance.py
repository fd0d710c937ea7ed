"""What every fighter in the registry promises, under any ruleset."""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from arena.errors import BoardError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, UnitType, load
from arena.game.types import Team
from arena.policy import BatchPolicy
from policies import registry
from policies.search.planner import LEAST_BUDGET, PlannerFast

TICKS = 25
FIGHTERS = [name for name in registry.names() if name not in ("planner", "planner-deep")]
"""Those two are planner-fast with more time; tests/policies/search has several lines of thought, as planner-deep does."""
teams = st.sampled_from(Team)
seeds = st.integers(0, 2**32)


@pytest.fixture(scope="module", autouse=True)
def planners_think_little() -> Iterator[None]:
    """What every fighter promises, a planner promises however short it thinks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlannerFast, "budget", LEAST_BUDGET)
        patch.setattr(PlannerFast, "n_worlds", 16)
        yield


@st.composite
def rulesets(draw: st.DrawFn) -> Ruleset:
    side = 2 * draw(st.one_of(st.integers(2, 12), st.integers(2, 32)))
    walkers = [draw(st.integers(0, 16)) for _ in Team]
    flyers = [draw(st.integers(0, min(4, 16 - n))) for n in walkers]
    sight = st.integers(0, 8)
    ugv = UnitType(name="ugv", step=draw(st.integers(0, 1)), sight=draw(sight), blue=walkers[0], red=walkers[1])
    uav = UnitType(name="uav", step=draw(st.integers(0, 8)), sight=draw(sight), flies=True, blue=flyers[0], red=flyers[1])
    return Ruleset(name="any", side=side, fog=draw(st.sampled_from([True, True, False])), units=(ugv, uav))


def decide(policy: BatchPolicy, observations: Observations) -> np.ndarray:
    """Return the orders, written where a venue keeps both teams' orders side by side."""
    n_units = observations.cell.shape[1]
    both = np.full((len(observations), n_units + 2), 77, np.int8)
    policy.act(observations, both[:, 1:-1])
    assert (both[:, [0, -1]] == 77).all(), "wrote past its own orders"
    return both[:, 1:-1].copy()


def play(policy: BatchPolicy, matches: Sequence[Any], seen_in: Any, ticks: int = TICKS) -> np.ndarray:
    """Return the orders of each tick; shape (ticks, seats, units)."""
    record = []
    for _ in range(ticks):
        record.append(decide(policy, seen_in(matches)))
        for match, orders in zip(matches, record[-1], strict=True):
            match.go(orders)
    return np.array(record)


def make(name: str, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
    policy = registry.load(name)(ruleset, team, n_seats)
    policy.start(np.arange(n_seats))
    return policy


def assert_legal(observations: Observations, ruleset: Ruleset, orders: np.ndarray) -> None:
    for seat in range(len(observations)):
        legal = observations.seat(seat, ruleset).legal_actions
        assert legal[np.arange(len(legal)), orders[seat]].all()


@pytest.mark.parametrize("name", FIGHTERS)
@settings(max_examples=15, deadline=None)
@given(ruleset=rulesets(), team=teams, seed=seeds)
def test_no_order_is_illegal(name: str, pretend: Any, seen_in: Any, ruleset: Ruleset, team: Team, seed: int) -> None:
    matches = [pretend(ruleset, team, seed + i) for i in range(4)]
    policy = make(name, ruleset, team, 4)

    for _ in range(TICKS):
        observations = seen_in(matches)
        orders = decide(policy, observations)
        assert_legal(observations, ruleset, orders)
        for match, row in zip(matches, orders, strict=True):
            match.go(row)


@pytest.mark.parametrize("name", FIGHTERS)
@settings(max_examples=10, deadline=None)
@given(ruleset=rulesets(), team=teams, seed=seeds, place=st.integers(0, 6))
def test_a_seat_acts_alike_alone_and_anywhere_in_a_batch(
    name: str, pretend: Any, seen_in: Any, ruleset: Ruleset, team: Team, seed: int, place: int
) -> None:
    others = [pretend(ruleset, team, seed + 1 + i) for i in range(6)]
    others.insert(place, pretend(ruleset, team, seed))

    together = play(make(name, ruleset, team, 7), others, seen_in)
    alone = play(make(name, ruleset, team, 1), [pretend(ruleset, team, seed)], seen_in)

    np.testing.assert_array_equal(together[:, place], alone[:, 0])


@pytest.mark.parametrize("name", FIGHTERS)
@settings(max_examples=10, deadline=None)
@given(ruleset=rulesets(), team=teams, seed=seeds)
def test_a_seat_that_starts_again_forgets_and_no_other_does(
    name: str, pretend: Any, seen_in: Any, ruleset: Ruleset, team: Team, seed: int
) -> None:
    matches = [pretend(ruleset, team, seed + i) for i in range(3)]
    policy = make(name, ruleset, team, 3)
    before = play(policy, matches, seen_in)
    matches[1] = pretend(ruleset, team, seed + 9)
    policy.start(np.array([1]))

    after = play(policy, matches, seen_in)

    fresh = play(make(name, ruleset, team, 1), [pretend(ruleset, team, seed + 9)], seen_in)
    np.testing.assert_array_equal(after[:, 1], fresh[:, 0])
    unbroken = play(make(name, ruleset, team, 1), [pretend(ruleset, team, seed)], seen_in, 2 * TICKS)
    np.testing.assert_array_equal(np.concatenate([before, after])[:, 0], unbroken[:, 0])


@pytest.mark.parametrize("name", FIGHTERS)
def test_an_observation_is_only_read(name: str, pretend: Any, seen_in: Any) -> None:
    ruleset = load("paper")
    matches = [pretend(ruleset, Team.RED, seed) for seed in range(5)]
    policy = make(name, ruleset, Team.RED, 5)

    for _ in range(TICKS):
        observations, untouched = seen_in(matches), seen_in(matches)
        orders = decide(policy, observations)
        for field in fields(Observations):
            np.testing.assert_array_equal(getattr(observations, field.name), getattr(untouched, field.name))
        for match, row in zip(matches, orders, strict=True):
            match.go(row)


@pytest.mark.parametrize("name", FIGHTERS)
def test_no_seats_and_no_units_are_played(name: str, pretend: Any, seen_in: Any) -> None:
    nobody = Ruleset(name="nobody", side=4)
    paper = load("paper")

    assert play(make(name, nobody, Team.BLUE, 2), [pretend(nobody, Team.BLUE, i) for i in range(2)], seen_in).size == 0
    assert decide(make(name, paper, Team.BLUE, 0), seen_in([pretend(paper, Team.BLUE, 0)]).select(slice(0))).shape == (0, 6)


def play_games(ruleset: Ruleset, blue: str, red: str, n_games: int, check: bool = False) -> np.ndarray:
    """Return blue's score in each game."""
    games = BatchedGame(ruleset, n_games)
    keys = [MatchKeys(map_key=bytes([i % 251] * 32), match_key=bytes([i % 241] * 32)) for i in range(n_games)]
    games.start(range(n_games), keys)
    fighters = {Team.BLUE: make(blue, ruleset, Team.BLUE, n_games), Team.RED: make(red, ruleset, Team.RED, n_games)}
    orders = {team: np.zeros((n_games, games.n_units[team]), np.int8) for team in Team}
    for _ in range(ruleset.tick_limit):
        for team, observations in games.observe().items():
            fighters[team].act(observations, orders[team])
            if check:
                assert_legal(observations, ruleset, orders[team])
        games.step(np.concatenate([orders[Team.BLUE], orders[Team.RED]], axis=1))
    return games.observe()[Team.BLUE].score.copy()


@pytest.mark.parametrize("name", FIGHTERS)
@settings(max_examples=8, deadline=None)
@given(ruleset=rulesets(), seed=seeds)
def test_no_order_of_a_real_match_is_illegal(name: str, ruleset: Ruleset, seed: int) -> None:
    try:
        play_games(ruleset.with_({"tick_limit": 20}), name, name, 2, check=True)
    except BoardError:
        assume(False)


@pytest.mark.parametrize("name", ["roomba", "fighter", "rush", "spiral"])
def test_whoever_seeks_the_flag_takes_it_where_nobody_guards_it(name: str) -> None:
    score = play_games(load("exp1"), name, "random", 200)

    assert (score == 100).mean() > 0.9


def test_rush_beats_random() -> None:
    score = play_games(load("paper"), "rush", "random", 200)

    assert (score > 0).mean() > 0.75
