"""What is believed: never against the truth, and never from anything but the observations."""

from collections.abc import Iterator
from itertools import permutations
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
from arena.game.types import FLAGS, Code, Team
from policies import registry
from policies.belief.belief import FALLEN, HIDDEN_NOW, Belief, make_belief
from policies.belief.memory import sight_of
from policies.belief.team_rules import TeamRules, team_rules
from policies.belief.update import update

seeds = st.integers(0, 2**32)
players = st.sampled_from(["random", "rush", "fighter", "role_team", "defend"])


@st.composite
def rulesets(draw: st.DrawFn) -> Ruleset:
    walkers = [draw(st.integers(0, 5)) for _ in Team]
    flyers = [draw(st.integers(0, 2)) for _ in Team]
    ugv = UnitType(name="ugv", step=1, sight=draw(st.integers(0, 5)), attack=2, blue=walkers[0], red=walkers[1])
    uav = UnitType(name="uav", step=3, sight=draw(st.integers(0, 5)), flies=True, blue=flyers[0], red=flyers[1])
    return Ruleset(
        name="any", side=2 * draw(st.integers(4, 14)), fog=draw(st.sampled_from([True, True, False])), units=(ugv, uav)
    )


def play(
    ruleset: Ruleset, blue: str, red: str, seed: int, ticks: int = 30
) -> Iterator[tuple[BatchedGame, dict[Team, Observations]]]:
    """Yield a game as it goes: its truth, and what each team sees."""
    games, rng = BatchedGame(ruleset, 1), np.random.default_rng(seed)
    games.start([0], [MatchKeys(map_key=rng.bytes(32), match_key=rng.bytes(32))])
    fighters = {team: registry.load(name)(ruleset, team, 1) for team, name in zip(Team, (blue, red), strict=True)}
    for fighter in fighters.values():
        fighter.start(np.arange(1))
    for _ in range(ticks):
        seen = games.observe()
        yield games, seen
        orders = {team: np.zeros((1, games.n_units[team]), np.int8) for team in Team}
        for team, fighter in fighters.items():
            fighter.act(seen[team], orders[team])
        games.step(np.concatenate([orders[team] for team in Team], axis=1))
        if games.is_over[0]:
            return


def in_set(rows: np.ndarray, cell: int, side: int) -> bool:
    return bool(int(rows[cell // side]) >> (cell % side) & 1)


@settings(max_examples=30)
@given(rulesets(), players, players, seeds, st.sampled_from(Team))
def test_the_truth_is_never_ruled_out(ruleset: Ruleset, blue: str, red: str, seed: int, team: Team) -> None:
    belief, rules, side = make_belief(ruleset, team, 1), team_rules(ruleset, team), ruleset.side
    enemy = team.other
    try:
        for games, seen in play(ruleset, blue, red, seed):
            update(sight_of(seen[team]), belief, rules)

            ground = games.state.ground[0, : side * side]
            assert in_set(belief.flag_rows[0], int(np.flatnonzero(ground == FLAGS[enemy])[0]), side)
            assert in_set(belief.home_rows[0], int(np.flatnonzero(ground == FLAGS[team])[0]), side)
            first = games.n_units[Team.BLUE] if enemy is Team.RED else 0
            walkers = [first + i for i, unit in enumerate(ruleset.team(enemy)) if not unit.flies]
            places = [int(games.state.cell[0, unit]) for unit in walkers if games.state.alive[0, unit]]
            tracks = [rows for rows, cell in zip(belief.enemy_rows[0], belief.enemy_cell[0], strict=True) if cell != FALLEN]
            assert belief.n_enemies[0] == len(places) == len(tracks)
            assert any(
                all(in_set(rows, place, side) for rows, place in zip(order, places, strict=True))
                for order in permutations(tracks)
            )
    except BoardError:
        assume(False)


def by_hand(seen: Observations, ruleset: Ruleset, garbage: int) -> Observations:
    """Return what a bot is told, as arrays, with garbage in all that the arrays have beside it."""
    told, side, n_enemies = seen.seat(0, ruleset), seen.side, seen.enemy_cell.shape[1]
    ground = np.full((1, side * side + 5), garbage, np.int8)
    ground[0, : side * side] = told.ground.ravel()
    kinds = [unit.name for unit in ruleset.units]
    cells = [unit.row * side + unit.column for unit in told.enemies]
    rest = n_enemies - len(cells)
    return Observations.blank(
        ruleset, told.team, 1, tick=np.array([told.tick], np.int32), ground=ground,
        cell=np.array([[unit.row * side + unit.column for unit in told.units]], np.int16).reshape(1, -1),
        alive=np.array([[unit.alive for unit in told.units]], np.uint8).reshape(1, -1),
        enemy_cell=np.array([cells + [-1] * rest], np.int16).reshape(1, -1),
        enemy_flies=np.array([[unit.flies for unit in told.enemies] + [garbage % 2] * rest], np.uint8).reshape(1, -1),
        enemy_type=np.array([[kinds.index(unit.type) for unit in told.enemies] + [0] * rest], np.int8).reshape(1, -1),
        living=np.array([told.living], np.int16), score=np.array([told.score], np.int16), seed=np.array([told.seed], np.uint64),
    )  # fmt: skip


@settings(max_examples=15)
@given(rulesets(), players, players, seeds, st.sampled_from(Team), st.integers(9, 99))
def test_nothing_but_what_a_bot_is_told_makes_a_belief(
    ruleset: Ruleset, blue: str, red: str, seed: int, team: Team, garbage: int
) -> None:
    rules, one, other = team_rules(ruleset, team), make_belief(ruleset, team, 1), make_belief(ruleset, team, 1)
    try:
        for _, seen in play(ruleset, blue, red, seed):
            update(sight_of(seen[team]), one, rules)
            update(sight_of(by_hand(seen[team], ruleset, garbage)), other, rules)

            for name in set(Belief._fields) - {"work"}:
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    except BoardError:
        assume(False)


def watch(ticks: int) -> tuple[Belief, TeamRules, Observations]:
    ruleset = load("paper")
    belief, rules = make_belief(ruleset, Team.BLUE, 1), team_rules(ruleset, Team.BLUE)
    for _, seen in play(ruleset, "role_team", "rush", 5, ticks):
        update(sight_of(seen[Team.BLUE]), belief, rules)
    return belief, rules, seen[Team.BLUE]


def test_a_cell_is_dated_when_it_was_last_in_sight() -> None:
    belief, _, seen = watch(4)
    is_seen = seen.ground[0, :400] != Code.HIDDEN

    assert (belief.seen_at[0][is_seen] == seen.tick[0]).all()
    assert (belief.seen_at[0][~is_seen] < seen.tick[0]).all()
    assert ((belief.seen_at[0] < 0) == (belief.ground[0] == Code.HIDDEN)).all()
    assert (belief.seen_at[0] >= 0).sum() > is_seen.sum()


def test_the_posterior_of_the_flag_is_over_unseen_cells_of_the_enemys_half() -> None:
    belief, rules, _ = watch(1)
    cells = [cell for cell in range(400) if in_set(belief.flag_rows[0], cell, 20)]

    assert belief.n_flag_cells[0] == len(cells) < 200
    assert {belief.ground[0, cell] for cell in cells} == {Code.HIDDEN}
    is_east = belief.forward[0] > 0
    assert all((cell % 20 >= 10) == is_east for cell in cells)
    assert rules.enemy_step == 1


def test_an_enemy_in_sight_is_where_it_is_seen() -> None:
    ruleset, seen_once = load("exp2"), False
    belief, rules = make_belief(ruleset, Team.BLUE, 1), team_rules(ruleset, Team.BLUE)
    for _, seen in play(ruleset, "defend", "rush", 3, 5):
        update(sight_of(seen[Team.BLUE]), belief, rules)
        at = seen[Team.BLUE].enemy_cell[0][seen[Team.BLUE].enemy_cell[0] >= 0]
        assert sorted(belief.enemy_cell[0][belief.enemy_cell[0] >= 0].tolist()) == sorted(at.tolist())
        seen_once = seen_once or len(at) == 4
    assert seen_once


def test_an_enemy_lost_from_sight_spreads_by_a_step_a_tick(seen_in: Any, pretend: Any) -> None:
    ruleset = Ruleset(name="two", side=20, units=(UnitType(name="ugv", step=1, sight=3, blue=1, red=1),))
    match = pretend(ruleset, Team.BLUE, 1)
    match.ground[:] = np.where(np.arange(20) < 10, Code.BLUE_HALF, Code.RED_HALF)
    belief, rules = make_belief(ruleset, Team.BLUE, 1), team_rules(ruleset, Team.BLUE)
    sizes = []
    for own, enemy in ((209, 212), (209, 212), (0, 212), (0, 212)):
        match.cell[Team.BLUE][:], match.cell[Team.RED][:] = own, enemy
        update(sight_of(seen_in([match])), belief, rules)
        sizes.append(sum(int(row).bit_count() for row in belief.enemy_rows[0, 0]))
        match.tick += 1

    assert sizes == [1, 1, 5, 13]
    assert belief.enemy_cell[0, 0] == HIDDEN_NOW


def test_whoever_is_taken_for_another_may_still_be_where_that_one_was(seen_in: Any, pretend: Any) -> None:
    eye = UnitType(name="uav", step=3, sight=0, flies=True, blue=1)
    ruleset = Ruleset(name="two", side=20, units=(UnitType(name="ugv", step=1, sight=6, blue=1, red=2), eye))
    match = pretend(ruleset, Team.BLUE, 1)
    match.ground[:] = np.where(np.arange(20) < 10, Code.BLUE_HALF, Code.RED_HALF)
    belief, rules = make_belief(ruleset, Team.BLUE, 1), team_rules(ruleset, Team.BLUE)
    places = [(212, 219), (212, 218), (211, 217), (211, 213)]  # of one enemy, seen at first, and of another, seen at last
    for tick, (one, other) in enumerate(places):
        match.alive[Team.BLUE][0] = tick == 0
        match.cell[Team.BLUE][:] = 209, 213 if tick == 3 else 0
        match.cell[Team.RED][:] = one, other
        update(sight_of(seen_in([match])), belief, rules)
        match.tick += 1

    hidden = belief.enemy_rows[0][belief.enemy_cell[0] == HIDDEN_NOW]
    assert len(hidden) == 1
    assert in_set(hidden[0], 211, 20)


@pytest.mark.parametrize("team", Team)
def test_ways_lead_to_where_the_flags_may_be(team: Team) -> None:
    ruleset = load("paper")
    belief, rules = make_belief(ruleset, team, 1), team_rules(ruleset, team)
    for _, seen in play(ruleset, "role_team", "role_team", 8, 12):
        update(sight_of(seen[team]), belief, rules)

        for rows, steps in ((belief.flag_rows[0], belief.to_flag[0]), (belief.home_rows[0], belief.to_home[0])):
            assert [cell for cell in range(400) if steps[cell] == 0] == [cell for cell in range(400) if in_set(rows, cell, 20)]
