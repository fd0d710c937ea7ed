"""How many playouts fit a clock, on clocks that the tests wind and on a real one."""

import time
from collections.abc import Callable
from itertools import count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.game.ruleset import load
from arena.game.types import HALVES, Team
from policies.heuristics.role_team import RoleTeam
from policies.search.budget import SHARE, describe_budget, fit_budget, make_opening

COLD_S = 30.0


class Thinker:
    """Takes `fixed_s` and `each_s` for each playout on its own clock, and longer in the calls that `slow` names."""

    def __init__(self, fixed_s: float, each_s: float, slow: dict[int, float] | None = None) -> None:
        self.now_s = 0.0
        self._fixed_s, self._each_s, self._slow_s = fixed_s, each_s, {0: COLD_S, **(slow or {})}
        self._calls = count()

    def cost_s(self, n_playouts: int) -> float:
        return self._fixed_s + self._each_s * n_playouts

    def think(self, n_playouts: int) -> None:
        self.now_s += self.cost_s(n_playouts) + self._slow_s.get(next(self._calls), 0.0)

    def fit(self, wanted: int, least: int, turn_s: float) -> int:
        return fit_budget(self.think, wanted, least, turn_s, clock=lambda: self.now_s)


@given(
    fixed_s=st.floats(0.0, 0.1), each_s=st.floats(1e-6, 1e-2), turn_s=st.floats(1e-3, 1.0),
    least=st.integers(1, 100), more=st.integers(0, 5_000),
)  # fmt: skip
def test_as_many_playouts_are_taken_as_there_is_room_for(
    fixed_s: float, each_s: float, turn_s: float, least: int, more: int
) -> None:
    thinker = Thinker(fixed_s, each_s)
    room = int((SHARE * turn_s - fixed_s) / each_s)

    fits = thinker.fit(least + more, least, turn_s)

    assert fits == 0 or least <= fits <= least + more
    assert abs(fits - (0 if room < least else min(room, least + more))) <= 1 or abs(room - least) <= 1
    assert thinker.now_s - COLD_S <= max(6 * thinker.cost_s(least + more), 20 * turn_s) + 6 * thinker.cost_s(least)


@pytest.mark.parametrize("slow", [{1: 9.0}, {2: 9.0, 5: 9.0, 9: 9.0}])
def test_a_moment_in_which_the_machine_is_busy_changes_nothing(slow: dict[int, float]) -> None:
    room = (SHARE * 0.1 - 0.01) / 1e-4

    assert Thinker(0.01, 1e-4).fit(1_600, 40, 0.1) == pytest.approx(room, abs=1)
    assert Thinker(0.01, 1e-4, slow).fit(1_600, 40, 0.1) == pytest.approx(room, abs=1)


@pytest.mark.parametrize(("wanted", "least"), [(0, 0), (100, 0), (10, 11)])
def test_a_budget_of_nothing_is_refused(wanted: int, least: int) -> None:
    with pytest.raises(ValueError, match="a budget is one or more"):
        Thinker(0.0, 1.0).fit(wanted, least, 1.0)


@pytest.fixture
def work() -> Callable[[int], object]:
    """Do something real, which takes longer the more often it is done."""
    numbers = np.random.default_rng(0).random(2_000)
    return lambda n: [np.sort(numbers) for _ in range(n)]


@pytest.mark.parametrize(("turn_s", "wanted"), [(1e-7, 0), (3_600.0, 32)])
def test_real_work_is_measured(turn_s: float, wanted: int, work: Callable[[int], object]) -> None:
    assert fit_budget(work, 32, 4, turn_s) == wanted


def test_real_work_takes_about_its_share_of_the_turn(work: Callable[[int], object]) -> None:
    turn_s = 0.02
    clock = time.thread_time  # what other processes do meanwhile is none of this test's business

    fits = fit_budget(work, 10**9, 1, turn_s, clock=clock)

    taken = []
    for _ in range(5):
        began_s = clock()
        work(fits)
        taken.append(clock() - began_s)
    assert SHARE * turn_s / 4 < min(taken) < turn_s


@pytest.mark.parametrize("rules", ["paper", "gym-cap", "mirror"])
@pytest.mark.parametrize("team", Team)
def test_an_opening_shows_all_own_units_alive_on_cells_of_their_own_in_their_half(rules: str, team: Team) -> None:
    ruleset = load(rules)

    opening = make_opening(ruleset, team)

    seen = opening.seat(0, ruleset)
    cells = {(unit.row, unit.column) for unit in seen.units if unit.alive}
    assert len(cells) == len(ruleset.team(team)) == opening.living[0, 0]
    assert all(seen.ground[cell] == HALVES[team] for cell in cells)
    orders = np.full((1, len(cells)), -1, np.int8)
    fighter = RoleTeam(ruleset, team, 1)
    fighter.start(np.zeros(1, np.intp))
    fighter.act(opening, orders)
    assert orders.any(), "its units have somewhere to go"


def test_what_a_clock_leaves_of_a_budget_is_said_in_a_sentence() -> None:
    assert describe_budget("planner", 1_600, 1_600, 40, 1.0, "role_team") == ""
    assert describe_budget("planner", 300, 1_600, 40, 0.02, "role_team") == (
        "planner: turns of 0.02 s leave room for 300 of its 1,600 playouts"
    )
    assert describe_budget("planner", 0, 1_600, 40, 0.001, "role_team") == (
        "planner: turns of 0.001 s are too short for its least budget of 40 playouts; it plays the orders of role_team"
    )
