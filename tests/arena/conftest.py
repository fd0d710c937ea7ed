"""Small matches, played whole."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load
from arena.local.venue import MatchRecord, play_batch
from arena.policy import BatchFactory, BatchPolicy, Orders
from arena.records.plan import MatchPlan

SMALL_BOARD = """
F..u
U...
..A.
a..f
"""


class Wanderer(BatchPolicy):
    """Any order, by the seat's own seed."""

    def act(self, observations: Observations, orders: Orders) -> None:
        for seat, seed in enumerate(observations.seed):
            orders[seat] = np.random.default_rng(seed).integers(5, size=orders.shape[1])


def plan(identity: str, blue: str = "one", red: str = "other") -> MatchPlan:
    secret = secret_from_seed(2)
    keys = MatchKeys(map_key=derive_map_key(secret, identity, 0), match_key=derive_match_key(secret, identity))
    return MatchPlan(identity=identity, blue=blue, red=red, keys=keys)


@pytest.fixture(scope="session")
def small_rules() -> Ruleset:
    """Return rules whose journals are about 1,000 bytes: every one of them can be tried."""
    return load("paper").with_({"board": SMALL_BOARD, "tick_limit": 8})


@pytest.fixture(scope="session")
def planned() -> Callable[..., MatchPlan]:
    return plan


@pytest.fixture(scope="session")
def played() -> Callable[..., MatchRecord]:
    """Play one match of two wanderers, or of whom is given."""

    def play(
        ruleset: Ruleset, identity: str = "small/0", blue: BatchFactory = Wanderer, red: BatchFactory = Wanderer
    ) -> MatchRecord:
        [record] = play_batch(ruleset, [plan(identity)], blue, red)
        return record

    return play


@pytest.fixture(scope="session")
def small_journal(small_rules: Ruleset, played: Callable[..., MatchRecord]) -> bytes:
    """Return a journal of some ticks."""
    records = (played(small_rules, f"small/{number}") for number in range(100))
    return next(record.journal for record in records if 3 <= record.result.ticks <= 5 and record.journal)


@pytest.fixture(scope="session")
def every_tick() -> Callable[[Sequence[int]], BatchFactory]:
    """Make a fighter that gives all its units the same orders at each tick."""

    def make(orders_of_a_tick: Sequence[int]) -> BatchFactory:
        class Stubborn(BatchPolicy):
            def act(self, observations: Observations, orders: Orders) -> None:
                orders[:] = orders_of_a_tick

        return Stubborn

    return make
