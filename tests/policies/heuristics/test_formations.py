"""Where scripts stand to each other: lanes of those who wait at home, and pairs that keep together."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from arena.game.keys import secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.local.venue import play_batch
from arena.policy import BatchFactory, BatchPolicy, Orders
from policies.heuristics.believing import BelievingPolicy
from policies.heuristics.border_hunter import BorderHunter
from policies.heuristics.defend import Defend
from policies.heuristics.squad import Squad
from policies.heuristics.turtle import Turtle
from policies.tactics.roles import GUARD, NORTH, SOUTH
from tournaments.fixture import plan_fixture

PAPER = load("paper")
SIDE = PAPER.side
LAST_OF_WAITING = 49
N_PAIRS = 20


class Still(BatchPolicy):
    """Stays."""

    def act(self, observations: Observations, orders: Orders) -> None:
        """Stay."""


Note = Callable[[BelievingPolicy, Observations], None]


class Watched(BatchPolicy):
    """Shows a note-taker what a fighter thinks, tick by tick."""

    def __init__(self, fighter: BelievingPolicy, note: Note) -> None:
        super().__init__(fighter.ruleset, fighter.team, fighter.n_seats)
        self._fighter, self._note = fighter, note

    def start(self, seats: NDArray[np.intp]) -> None:
        """Begin."""
        self._fighter.start(seats)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Decide, and show it."""
        self._fighter.act(observations, orders)
        self._note(self._fighter, observations)


def play(kind: type[BelievingPolicy], team: Team, opponent: BatchFactory, note: Note) -> None:
    """Let a fighter play one team in some matches, each alone, and be watched."""

    def make(ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        return Watched(kind(ruleset, team, n_seats), note)

    for plan in plan_fixture("formations", "one", "two", N_PAIRS, secret_from_seed(3)):
        if (plan.blue == "one") == (team is Team.BLUE):
            pair = (make, opponent) if team is Team.BLUE else (opponent, make)
            assert list(play_batch(PAPER, [plan], *pair))


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("fighter", [Turtle, BorderHunter])
def test_where_nobody_comes_one_waits_at_the_flag_and_the_others_in_two_lanes(fighter: type[BelievingPolicy], team: Team) -> None:
    seen: list[tuple[int, dict[int, list[tuple[int, int]]]]] = []

    def note(one: BelievingPolicy, observations: Observations) -> None:
        if observations.tick[0] == LAST_OF_WAITING and one.plan.raided_at[0] == 0:
            places: dict[int, list[tuple[int, int]]] = {}
            for unit in np.flatnonzero(one.plan.role >= 0):
                places.setdefault(int(one.plan.role[unit]), []).append(divmod(int(observations.cell[0, unit]), SIDE))
            seen.append((3 if one.belief.forward[0] > 0 else 16, places))

    play(fighter, team, Still, note)

    assert len(seen) > N_PAIRS / 2
    n_held = 0
    for column, places in seen:
        lanes = {lane: places.get(lane, []) for lane in (NORTH, SOUTH)}
        for lane, row in ((NORTH, 5), (SOUTH, 15)):
            n_held += any(abs(at[0] - row) <= 3 and abs(at[1] - column) <= 1 for at in lanes[lane])
        if all(lanes.values()):
            assert len(places[GUARD]) == 1, places
    assert n_held > 0.8 * 2 * len(seen)  # obstacles may close a lane


def test_mates_keep_within_two_cells() -> None:
    apart: list[int] = []

    def note(one: BelievingPolicy, observations: Observations) -> None:
        for unit, mate in enumerate(one.plan.mate):
            if mate > unit:
                assert one.plan.mate[mate] == unit
                here, there = (divmod(int(observations.cell[0, each]), SIDE) for each in (unit, mate))
                apart.append(max(abs(here[0] - there[0]), abs(here[1] - there[1])))

    play(Squad, Team.BLUE, Defend, note)

    assert len(apart) > 20 * N_PAIRS
    assert np.mean(np.array(apart) <= 2) > 0.75
