"""The cheat: only `arena play` seats it, every table says what it is, and it alone is shown more than the fog lets through."""

import json
import subprocess
from collections.abc import Callable

import numpy as np
import pytest

from arena.errors import PolicyError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import load as load_rules
from arena.game.types import Code, Team
from arena.local.venue import play_batch
from arena.policy import BatchPolicy, Orders
from arena.records.plan import MatchPlan
from policies import registry

Run = Callable[..., subprocess.CompletedProcess[str]]
HIDDEN_CELLS: dict[bool, int] = {}


class Honest(BatchPolicy):
    """Stays, and counts what it is not shown."""

    def act(self, observations: Observations, orders: Orders) -> None:
        n_hidden = int((observations.ground[:, : observations.side**2] == Code.HIDDEN).sum())
        HIDDEN_CELLS[self.is_cheat] = HIDDEN_CELLS.get(self.is_cheat, 0) + n_hidden


class Cheat(Honest):
    is_cheat = True


@pytest.mark.parametrize(("blue", "red"), [(Honest, Cheat), (Cheat, Honest)])
def test_a_cheat_sees_all_and_whoever_meets_it_no_more_than_before(blue: type[Honest], red: type[Honest]) -> None:
    HIDDEN_CELLS.clear()
    keys = MatchKeys(map_key=bytes(32), match_key=bytes(32))

    list(play_batch(load_rules("paper"), [MatchPlan(identity="a", blue="a", red="b", keys=keys)], blue, red))

    assert HIDDEN_CELLS[True] == 0
    assert HIDDEN_CELLS[False] > 0


def test_without_fog_a_game_goes_on_as_before() -> None:
    secret = secret_from_seed(3)
    games = BatchedGame(load_rules("paper"), 2)
    keys = [MatchKeys(map_key=derive_map_key(secret, "a", i), match_key=derive_match_key(secret, str(i))) for i in range(2)]
    games.start(range(2), keys)
    games.observe_without_fog()
    games.step(np.full(games.state.cell.shape, 2, np.int8))
    before = games.digestible()

    seen, fogged = games.observe_without_fog(), games.observe()

    np.testing.assert_array_equal(games.digestible(), before)
    for team in Team:
        np.testing.assert_array_equal(seen[team].cell, fogged[team].cell)
        np.testing.assert_array_equal(seen[team].seed, fogged[team].seed)
        assert (seen[team].enemy_cell >= 0).all()
        assert (fogged[team].ground[:, :400] == Code.HIDDEN).any()


def test_no_one_but_play_seats_a_cheat() -> None:
    with pytest.raises(PolicyError, match="is a cheat"):
        registry.load("oracle_rush")

    assert "oracle_rush" not in registry.names()
    assert registry.load("oracle_rush", cheats=True)(load_rules("paper"), Team.RED, 1).is_cheat


def test_a_table_says_who_cheats(arena: Run) -> None:
    done = arena("play", "oracle_rush", "random", "--pairs", 2, "--seed", 1, "--workers", 1, "--json")

    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["a"] == "oracle_rush-cheat"
    assert "A cheat" in arena("policies").stdout


def test_a_pit_refuses_a_cheat_in_a_sentence(arena: Run) -> None:
    done = arena("join", "--policy", "oracle_rush")

    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "is a cheat" in done.stderr
