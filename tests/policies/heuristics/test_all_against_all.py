"""Every script of ours, and a planner, meets every other and itself on random rulesets: each game can be played to its end."""

import os
from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arena.errors import BoardError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset, UnitType
from arena.game.types import Team, Termination
from policies import registry

IS_FULL = os.environ.get("ARENA_TEST_SIZE") == "full"
PAIRS = list(combinations_with_replacement(("planner-fast", *registry.SCRIPTS), 2))[:: 1 if IS_FULL else 6]
BOARDS = (
    """
    F . . # . . . f
    . u . # . . U .
    . . . # . . . .
    . U . . . . u .
    . . . . # . . .
    . . . . # . . .
    . . U . # . . u
    . . . . # . . .""",
    """
    . U . u
    F . . f
    . . . .
    # . . #""",
)


@st.composite
def rulesets(draw: st.DrawFn) -> Ruleset:
    limit, combat = draw(st.integers(1, 30)), draw(st.booleans())
    if draw(st.integers(0, 3)) == 0:
        board = draw(st.sampled_from(BOARDS))
        return Ruleset(name="drawn", board=board, random_combat=combat, tick_limit=limit, units=_units(0, 0, 0))
    side = 2 * draw(st.one_of(st.integers(4, 10), st.integers(4, 32)))
    n_walkers = draw(st.integers(1, 16 if side >= 20 else 4))
    n_enemies = draw(st.sampled_from([0, 1, n_walkers]))
    n_flyers = draw(st.integers(0, min(3, 16 - n_walkers)))
    units = _units(n_walkers, n_enemies, n_flyers)
    return Ruleset(name="any", side=side, random_combat=combat, tick_limit=limit, units=units)


def _units(n_walkers: int, n_enemies: int, n_flyers: int) -> tuple[UnitType, ...]:
    ugv = UnitType(name="ugv", step=1, sight=3, attack=2, strength=1, blue=n_walkers, red=n_enemies)
    return ugv, UnitType(name="uav", step=3, sight=4, flies=True, blue=n_flyers, red=n_flyers)


@pytest.mark.parametrize(("blue", "red"), PAIRS)
@settings(deadline=None, max_examples=10 if IS_FULL else 3)
@given(ruleset=rulesets(), key=st.binary(min_size=32, max_size=32))
def test_every_two_fighters_play_every_ruleset_to_its_end_without_an_illegal_order(
    blue: str, red: str, ruleset: Ruleset, key: bytes
) -> None:
    games = BatchedGame(ruleset, 1)
    try:
        games.start(range(1), [MatchKeys(map_key=key, match_key=key)])
    except BoardError:
        return  # so full of units that no board could be drawn: the arena says so before any match
    fighters = {team: registry.load(name)(ruleset, team, 1) for team, name in ((Team.BLUE, blue), (Team.RED, red))}
    orders = {team: np.zeros((1, games.n_units[team]), np.int8) for team in Team}
    for team in Team:
        fighters[team].start(np.arange(1))

    for _ in range(ruleset.tick_limit):
        for team, observations in games.observe().items():
            fighters[team].act(observations, orders[team])
            legal = observations.seat(0, ruleset).legal_actions
            assert legal[np.arange(len(legal)), orders[team][0]].all()
        games.step(np.concatenate([orders[Team.BLUE], orders[Team.RED]], axis=1))

    assert games.is_over.all()
    assert Termination(games.state.field[0, 1]) is not Termination.RUNNING
