"""A planner: its orders follow from what its seat was shown, whatever the rules, and never fall below its blueprint's."""

import math
import os
import time
import tracemalloc
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from lookalikes import another_truth
from numpy.typing import NDArray
from quick import Daring, DaringDeep, Quick, begin_games, decide, play_tick, seat
from worlds import lay, rules_for

from arena.game.observation import Observations
from arena.game.ruleset import RULESETS, Ruleset, load
from arena.game.state import StateField
from arena.game.types import Team
from arena.policy import BatchFactory, Orders
from policies.heuristics.role_team import RoleTeam
from policies.heuristics.rush import Rush
from policies.registry import PLANNERS
from policies.registry import load as load_policy
from policies.search.budget import SHARE, make_opening
from policies.search.climb import BLUEPRINT, Effort
from policies.search.mind import Mind
from policies.search.planner import LEAST_BUDGET, MOST_SIDE, Planner

PAPER = load("paper")
TICKS = 25
BOARD = """
    F . . # . . . f
    . u . # . . U .
    . . . # . . . .
    . U . . . . u .
    . . . . # . . .
    . . . . # . . .
    . . U . # . . u
    . A . . # . . a"""


def play(
    make: BatchFactory, seeds: Sequence[int], *, team: Team = Team.BLUE, before: int | None = None, **set_to: Any
) -> NDArray[np.int8]:
    """Return a planner's orders against `rush`, shape (ticks, games, units); it may have played another match before."""
    fighters = {Team.BLUE: seat(make, PAPER, Team.BLUE, len(seeds)), Team.RED: seat(Rush, PAPER, Team.RED, len(seeds))}
    for name, value in set_to.items():
        setattr(fighters[Team.BLUE], name, value)
    if before is not None:
        earlier = begin_games(PAPER, [before] * len(seeds))
        for _ in range(TICKS):
            play_tick(earlier, fighters)
        for fighter in fighters.values():
            fighter.start(np.arange(len(seeds)))
    games = begin_games(PAPER, seeds)
    return np.array([play_tick(games, fighters)[Team.BLUE] for _ in range(TICKS)])


@pytest.mark.parametrize("rules", ["paper", "gym-cap"])
@pytest.mark.parametrize("team", Team)
def test_two_states_that_look_alike_to_a_seat_get_the_same_orders(
    team: Team, rules: str, size: Callable[[int, int], int]
) -> None:
    ruleset, rng, happened = load(rules), np.random.default_rng(5), Counter[str]()
    enemy, knows, thinks = seat(Rush, ruleset, team.other), seat(Daring, ruleset, team), seat(Daring, ruleset, team)
    for seed in range(size(2, 40)):
        games = begin_games(ruleset, [seed])
        for fighter in (enemy, knows, thinks):
            fighter.start(np.arange(1))
        for _ in range(12):
            other = another_truth(games, team, rng)
            seen = games.observe()
            orders = {team: decide(knows, seen[team]), team.other: decide(enemy, seen[team.other])}
            np.testing.assert_array_equal(orders[team], decide(thinks, other.games.observe()[team]))
            games.step(np.concatenate([orders[one] for one in Team], axis=1))
            happened.update(other.kinds)
    assert min(happened[kind] for kind in ("a hidden enemy", "a hidden flag", "a hidden cell", "an index in sight")) > 0


@pytest.mark.parametrize("make", [Daring, DaringDeep])
def test_its_orders_are_the_same_anew_in_any_batch_after_another_match_and_with_what_it_explains(make: type[Planner]) -> None:
    alone = play(make, [3])

    np.testing.assert_array_equal(play(make, [3], before=9), alone)
    np.testing.assert_array_equal(play(make, [3], keeps_annotations=True, explains=True), alone)
    together = play(make, [1, 3, 7])
    np.testing.assert_array_equal(together[:, 1], alone[:, 0])
    assert (together[:, 0] != together[:, 1]).any()


def test_its_orders_do_not_depend_on_how_many_threads_carry_its_thoughts(monkeypatch: pytest.MonkeyPatch) -> None:
    played = []
    for n_threads in (1, 3):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _, n=n_threads: set(range(n)))
        planner = DaringDeep(PAPER, Team.BLUE, 1)
        assert planner._pool is not None
        assert planner._pool._max_workers == n_threads
        played.append(play(DaringDeep, [3]))

    np.testing.assert_array_equal(*played)


UNITS: dict[str, dict[str, Any]] = {
    "of 2": {"ugv": {"blue": 2, "red": 2}, "uav": {"blue": 1, "red": 1}},
    "of 8": {"ugv": {"blue": 6, "red": 6}, "uav": {"blue": 2, "red": 2}},
    "without walkers": {"ugv": {"blue": 0}, "uav": {"blue": 3}},
    "without flyers": {"uav": {"blue": 0, "red": 0}},
    "without enemies": {"ugv": {"red": 0}, "uav": {"red": 0}},
    "of one against all": {"ugv": {"blue": 1}, "uav": {"blue": 0}},
}
ANY_RULES = {
    **{name: load(name) for name in RULESETS},
    **{f"teams {name}": PAPER.with_({"units": units}) for name, units in UNITS.items()},
    **{f"side {side}": PAPER.with_({"side": side}) for side in (16, 32, MOST_SIDE)},
    "a board": rules_for(BOARD),
    "no fog": PAPER.with_({"fog": False}),
    "certain combat": PAPER.with_({"random_combat": False, "attack_at_range": False}),
}


@pytest.mark.parametrize("name", ANY_RULES)
def test_it_plays_legal_orders_to_the_end_under_any_rules(name: str) -> None:
    ruleset = ANY_RULES[name].with_({"tick_limit": 30})
    games = begin_games(ruleset, [4])
    fighters = {team: seat(Quick, ruleset, team) for team in Team}

    while not games.is_over.all():
        orders = play_tick_legally(games, fighters, ruleset)
        assert (orders >= 0).all()
    assert all(planner._effort.budget == LEAST_BUDGET for planner in fighters.values())


def play_tick_legally(games: Any, fighters: Any, ruleset: Ruleset) -> NDArray[np.int8]:
    legal = [games.observe()[team].seat(0, ruleset).legal_actions for team in Team]
    orders = play_tick(games, fighters)
    for team in Team:
        assert legal[team][np.arange(len(legal[team])), orders[team][0]].all()
    return np.concatenate([orders[team][0] for team in Team])


# Where it cannot think


def assert_plays_its_blueprint(planners: Sequence[Planner], ruleset: Ruleset) -> None:
    games = begin_games(ruleset, [2])
    fighters = {Team.BLUE: seat(RoleTeam, ruleset, Team.BLUE), Team.RED: seat(Rush, ruleset, Team.RED)}
    for planner in planners:
        planner.start(np.arange(1))
    for _ in range(10):
        decided = [decide(planner, games.observe()[Team.BLUE]) for planner in planners]
        orders = play_tick(games, fighters)
        for own in decided:
            np.testing.assert_array_equal(own, orders[Team.BLUE])


def test_on_a_board_that_is_too_large_it_plays_its_blueprint_and_says_so_once(caplog: pytest.LogCaptureFixture) -> None:
    ruleset = PAPER.with_({"side": MOST_SIDE + 2})

    class Lost(Quick):
        name = "lost"

    planners = [Lost(ruleset, Team.BLUE, 1), Lost(ruleset, Team.BLUE, 1)]
    planners[1].set_turn_time(1.0)  # there is nothing to be measured

    assert [record.getMessage() for record in caplog.records] == [
        f"lost: it looks ahead on boards of up to {MOST_SIDE} cells a side, and paper has {MOST_SIDE + 2}; "
        "it plays the orders of role_team"
    ]
    assert_plays_its_blueprint(planners, ruleset)


def test_in_turns_that_are_too_short_it_plays_its_blueprint_and_says_so_once(caplog: pytest.LogCaptureFixture) -> None:
    class Hurried(Quick):
        name = "hurried"

    planners = [Hurried(PAPER, Team.BLUE, 1), Hurried(PAPER, Team.BLUE, 1)]
    for planner in planners:
        planner.set_turn_time(1e-6)

    assert [record.getMessage() for record in caplog.records] == [
        f"hurried: turns of 1e-06 s are too short for its least budget of {LEAST_BUDGET} playouts; "
        "it plays the orders of role_team"
    ]
    assert_plays_its_blueprint(planners, PAPER)


def thinks_for_s(make: type[Planner]) -> float:
    """Return how long a planner thinks about a tick."""
    planner, taken = make(PAPER, Team.BLUE, 1), []
    for _ in range(4):
        planner.start(np.arange(1))
        began_s = time.monotonic()
        decide(planner, make_opening(PAPER, Team.BLUE))
        taken.append(time.monotonic() - began_s)
    return min(taken)


def test_in_short_turns_it_thinks_less_and_says_so_once(caplog: pytest.LogCaptureFixture) -> None:
    class Thorough(Quick):
        name = "thorough"
        budget = 1_000_000
        n_worlds = 512

    class Hasty(Thorough):
        budget = LEAST_BUDGET

    turn_s = round(math.sqrt(thinks_for_s(Hasty) * thinks_for_s(Thorough)) / SHARE, 3)  # on this machine
    planners = [Thorough(PAPER, Team.BLUE, 1), Thorough(PAPER, Team.BLUE, 1)]
    for planner in planners:
        planner.set_turn_time(turn_s)

    budget = planners[0]._effort.budget
    assert LEAST_BUDGET <= budget < Thorough.budget
    assert planners[1]._effort == planners[0]._effort == Effort.of(budget)
    assert [record.getMessage() for record in caplog.records] == [
        f"thorough: turns of {turn_s:.3g} s leave room for {budget:,} of its {Thorough.budget:,} playouts"
    ]


def test_in_long_turns_it_thinks_as_ever_and_says_nothing(caplog: pytest.LogCaptureFixture) -> None:
    planner = Quick(PAPER, Team.BLUE, 1)

    planner.set_turn_time(60.0)

    assert planner._effort == Effort.of(Quick.budget)
    assert caplog.records == []


# What comes of thinking


@pytest.mark.parametrize("seed", range(4))
def test_a_flag_that_can_be_had_next_tick_is_taken_though_the_blueprint_dawdles(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    ruleset = rules_for("""
        F . u . . . . .
        . . . . . . . .
        . A . . . . U f
        . . . # . . . .
        . . . . . . . .
        . . . . . . . .
        u . . . . . . .
        . . U . . . . .""")  # which would lose the race for the flags in the tick that it loses
    games = lay(ruleset, seed=seed)
    mind = Mind(ruleset, Team.BLUE, Quick.n_worlds, n_lines=1)
    think = mind.blueprint.act

    def dawdle(observations: Observations, orders: Orders) -> None:
        think(observations, orders)
        orders[:] = 0

    monkeypatch.setattr(mind.blueprint, "act", dawdle)
    orders = np.zeros(games.state.cell.shape, np.int8)
    orders[0, : games.n_units[Team.BLUE]] = mind.act(games.observe()[Team.BLUE], Effort.of(Quick.budget), None)
    games.step(orders)

    assert games.state.field[0, StateField.SCORE] == 100


def test_the_chances_of_first_steps_are_higher_the_surer_a_planner_is_of_its_orders() -> None:
    games, enemy = begin_games(PAPER, [5]), seat(Rush, PAPER, Team.RED)
    mind, effort, everyone = Mind(PAPER, Team.BLUE, n_worlds=16, n_lines=1), Effort.of(4 * LEAST_BUDGET), np.arange(6)
    taken = Counter[int]()

    for _ in range(TICKS):
        seen = games.observe()
        orders = mind.act(seen[Team.BLUE], effort, None).copy()
        chances = mind.first_steps()
        least = 0.69 if mind.taken != BLUEPRINT else 0.3  # 0.5 standard errors are a chance of 0.7
        taken.update([mind.taken])
        np.testing.assert_allclose(chances.sum(1), 1, rtol=1e-5)
        assert (np.count_nonzero(chances, axis=1) <= 2).all()
        assert (chances[everyone, orders] >= least).all()
        games.step(np.concatenate([orders[None], decide(enemy, seen[Team.RED])], axis=1))

    assert len(taken) == 2
    mind.act(games.observe()[Team.BLUE], effort._replace(budget=0), None)
    assert set(np.unique(mind.first_steps())) == {0.0, 1.0}  # without a thought, it is its blueprint


def test_a_lead_that_is_not_significant_leaves_the_blueprint_s_orders() -> None:
    games, enemy = begin_games(PAPER, [5]), seat(Rush, PAPER, Team.RED)
    sceptic, believer = (Mind(PAPER, Team.BLUE, n_worlds=16, n_lines=1) for _ in range(2))
    blueprint = seat(RoleTeam, PAPER, Team.BLUE)
    effort, taken = Effort.of(4 * LEAST_BUDGET), Counter[int]()

    for _ in range(TICKS):
        seen = games.observe()
        orders = decide(blueprint, seen[Team.BLUE])
        np.testing.assert_array_equal(sceptic.act(seen[Team.BLUE], effort._replace(is_sure=1e9), None), orders[0])
        believer.act(seen[Team.BLUE], effort._replace(is_sure=-1e9), None)
        taken.update([sceptic.taken, believer.taken])
        games.step(np.concatenate([orders, decide(enemy, seen[Team.RED])], axis=1))

    assert taken[BLUEPRINT] == TICKS


@pytest.mark.parametrize(("name", "side"), [*((name, PAPER.side) for name in PLANNERS), ("planner-deep", MOST_SIDE)])
def test_a_seat_remembers_less_than_300_megabytes(name: str, side: int) -> None:
    ruleset = PAPER.with_({"side": side})
    make = load_policy(name)
    seen = begin_games(ruleset, [1]).observe()[Team.BLUE]
    tracemalloc.start()
    try:
        planner = seat(make, ruleset, Team.BLUE)
        decide(planner, seen)
        held, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert side**4 < held <= most < 300e6  # the ways between all cells alone take side ** 4 bytes
