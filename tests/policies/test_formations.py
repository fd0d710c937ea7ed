"""Where scripts stand to each other: lanes of those who wait at home, and pairs that keep together."""

import numpy as np
import pytest

from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team
from arena.observation import Observations
from arena.policy import BatchFactory, BatchPolicy, Orders
from arena.referee.local import play_batch
from policies.believing import BelievingPolicy
from policies.heuristics.border_hunter import BorderHunter
from policies.heuristics.defend import Defend
from policies.heuristics.squad import Squad
from policies.heuristics.turtle import Turtle
from policies.memory import Sight
from policies.tactics import GUARD, NORTH, SOUTH
from tournaments.fixture import plan_fixture

PAPER = load("paper")
SIDE = PAPER.side
LAST_OF_WAITING = 49
N_PAIRS = 20


class Still(BatchPolicy):
    """Stays."""

    def act(self, observations: Observations, orders: Orders) -> None:
        """Stay."""


def play(make: BatchFactory, team: Team, opponent: BatchFactory) -> None:
    """Let a fighter play one team in some matches, each alone."""
    for plan in plan_fixture("formations", "one", "two", N_PAIRS, secret_from_seed(3)):
        if (plan.blue == "one") == (team is Team.BLUE):
            pair = (make, opponent) if team is Team.BLUE else (opponent, make)
            assert list(play_batch(PAPER, [plan], *pair))


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("fighter", [Turtle, BorderHunter])
def test_where_nobody_comes_one_waits_at_the_flag_and_the_others_in_two_lanes(fighter: type[BelievingPolicy], team: Team) -> None:
    seen: list[tuple[int, dict[int, list[tuple[int, int]]]]] = []

    class Watched(fighter):  # type: ignore[misc, valid-type]
        def decide(self, sight: Sight, orders: Orders) -> None:
            super().decide(sight, orders)
            if sight.tick[0] == LAST_OF_WAITING and self.plan.raided_at[0] == 0:
                places: dict[int, list[tuple[int, int]]] = {}
                for unit in np.flatnonzero(self.plan.role >= 0):
                    places.setdefault(int(self.plan.role[unit]), []).append(divmod(int(sight.cell[0, unit]), SIDE))
                seen.append((3 if self.belief.forward[0] > 0 else 16, places))

    play(Watched, team, Still)

    assert len(seen) > N_PAIRS / 2
    n_held = 0
    for column, places in seen:
        lanes = {lane: places.get(lane, []) for lane in (NORTH, SOUTH)}
        for lane, row in ((NORTH, 5), (SOUTH, 15)):
            n_held += any(abs(at[0] - row) <= 3 and abs(at[1] - column) <= 1 for at in lanes[lane])
        if all(lanes.values()):
            assert len(places[GUARD]) == 1, places
    assert n_held > 0.8 * 2 * len(seen)  # obstacles may close a lane


class Pairs(Squad):
    """Notes how far mates are apart."""

    apart: list[int]

    def decide(self, sight: Sight, orders: Orders) -> None:
        """Decide, and note."""
        super().decide(sight, orders)
        for unit, mate in enumerate(self.plan.mate):
            if mate > unit:
                assert self.plan.mate[mate] == unit
                one, two = (divmod(int(sight.cell[0, each]), SIDE) for each in (unit, mate))
                self.apart.append(max(abs(one[0] - two[0]), abs(one[1] - two[1])))


def test_mates_keep_within_two_cells() -> None:
    Pairs.apart = []
    play(Pairs, Team.BLUE, Defend)

    assert len(Pairs.apart) > 20 * N_PAIRS
    assert np.mean(np.array(Pairs.apart) <= 2) > 0.75
