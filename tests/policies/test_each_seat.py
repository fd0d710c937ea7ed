from asyncio import CancelledError
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from arena.game.observation import Observation
from arena.game.ruleset import load
from arena.game.types import Team, Termination
from arena.policy import MatchInfo, MatchResult, explain_refusal, read_actions
from policies.each_seat import EachSeat, WithoutMemory

PAPER = load("paper")
RESULT = MatchResult(ending=Termination.CAPTURE, winner=Team.BLUE, score=100, ticks=9)


@pytest.fixture(scope="module")
def observations(pretend: Any, seen_in: Any) -> Any:
    return seen_in([pretend(PAPER, Team.BLUE, seed) for seed in range(3)])


class Diary:
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.told: list[Any] = []

    def start(self, info: MatchInfo) -> None:
        self.told.append(info)

    def act(self, observation: Observation) -> Sequence[int]:
        self.told.append(observation)
        return [1, 2, 3, 4, 0, 1]

    def end(self, result: MatchResult) -> None:
        self.told.append(result)


def play(make: Callable[[], Any], observations: Any, n_ticks: int = 1) -> tuple[EachSeat, np.ndarray]:
    policy = EachSeat(PAPER, Team.BLUE, 3, make=make)
    policy.start(np.arange(3))
    orders = np.full((3, 6), 9, np.int8)
    for _ in range(n_ticks):
        policy.act(observations, orders)
    return policy, orders


def test_each_seat_has_a_bot_of_its_own_that_hears_start_and_end(observations: Any) -> None:
    diaries: list[Diary] = []
    policy, orders = play(lambda: diaries.append(Diary()) or diaries[-1], observations)
    policy.end(1, RESULT)

    assert orders.tolist() == [[1, 2, 3, 4, 0, 1]] * 3
    info, observation, *rest = diaries[1].told
    assert info == MatchInfo(ruleset=PAPER, team=Team.BLUE)
    assert observation.seed == observations.seed[1]
    assert rest == [RESULT]
    assert len(diaries[0].told) == 2


def test_a_new_match_gets_a_new_bot(observations: Any) -> None:
    diaries: list[Diary] = []
    policy, orders = play(lambda: diaries.append(Diary()) or diaries[-1], observations)
    policy.start(np.array([2]))
    policy.act(observations, orders)

    assert [len(diary.told) for diary in diaries] == [3, 3, 2, 2]


def raises(observation: Observation) -> Sequence[int]:
    raise ValueError(f"no idea on tick {observation.tick}")


def test_a_bot_that_raises_stays_and_shows_its_own_traceback_once(observations: Any) -> None:
    policy, orders = play(lambda: WithoutMemory(raises), observations, n_ticks=3)

    faults = policy.take_faults(0)
    assert (orders == -1).all()
    assert (faults.raised, faults.illegal) == (3, 0)
    assert faults.first_traceback is not None
    assert faults.first_traceback.rstrip().endswith("ValueError: no idea on tick 0")
    assert faults.first_traceback.count("File ") == 1
    assert "in raises" in faults.first_traceback
    assert "each_seat" not in faults.first_traceback.replace(__file__, "")
    assert policy.take_faults(0).raised == 0


def test_one_bad_seat_costs_no_other(observations: Any) -> None:
    made: list[int] = []

    def make() -> Any:
        made.append(len(made))
        if made[-1] == 1:
            return WithoutMemory(lambda observation: "rubbish")
        if made[-1] == 2:
            raise RuntimeError("no weights")
        return WithoutMemory(lambda observation: [2] * 6)

    policy, orders = play(make, observations, n_ticks=2)

    assert orders.tolist() == [[2] * 6, [-1] * 6, [-1] * 6]
    faults = [policy.take_faults(seat) for seat in range(3)]
    assert [(fault.raised, fault.illegal) for fault in faults] == [(0, 0), (0, 2), (3, 0)]
    assert "no weights" in str(faults[2].first_traceback)


@pytest.mark.parametrize("event", ["start", "end"])
def test_start_and_end_that_raise_are_counted(observations: Any, event: str) -> None:
    class Grumbler(Diary):
        pass

    def grumble(self: Any, message: Any) -> None:
        raise OSError("grumble")

    setattr(Grumbler, event, grumble)
    policy, orders = play(Grumbler, observations)
    policy.end(0, RESULT)

    assert (orders[0] == [1, 2, 3, 4, 0, 1]).all()
    assert policy.take_faults(0).raised == 1


@pytest.mark.parametrize("error", [SystemExit, RecursionError, MemoryError, AssertionError, CancelledError])
def test_a_bot_can_stop_itself_alone(observations: Any, error: type[BaseException]) -> None:
    def give_up(observation: Observation) -> Sequence[int]:
        raise error

    policy, _ = play(lambda: WithoutMemory(give_up), observations)

    assert error.__name__ in str(policy.take_faults(0).first_traceback)


def test_ctrl_c_is_no_fault_of_the_bot(observations: Any) -> None:
    def interrupted(observation: Observation) -> Sequence[int]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        play(lambda: WithoutMemory(interrupted), observations)


def test_a_long_complaint_is_cut(observations: Any) -> None:
    def complain(observation: Observation) -> Sequence[int]:
        raise ValueError("x" * 1_000_000)

    policy, _ = play(lambda: WithoutMemory(complain), observations)

    assert len(policy.take_faults(0).first_traceback or "") < 5000


@pytest.mark.parametrize("answer", [[0, 1], (4, 4), np.array([1, 2]), np.array([1.0, 2.0]), [True, False], iter([3, 3])])
def test_any_sequence_of_actions_is_read(answer: Any) -> None:
    actions = read_actions(answer, 2)

    assert actions is not None
    assert actions.dtype == np.int8
    assert actions.shape == (2,)


@pytest.mark.parametrize(
    "answer",
    [
        None,
        3,
        "01",
        "ab",
        [1],
        [1, 2, 3],
        [5, 0],
        [-1, 0],
        [0.5, 1],
        [float("nan"), 1],
        [float("inf"), 1],
        [None, 1],
        [[1], [2]],
        {},
        {0: 2, 1: 3},
        {0, 1},
        np.array(1),
        [1j, 0],
        [2**70, 0],
        np.array([[1, 2], [3, 4]]),
        object(),
    ],
)
def test_what_is_not_one_action_per_unit_is_refused(answer: Any) -> None:
    assert read_actions(answer, 2) is None


def test_orders_by_unit_are_no_list_of_orders() -> None:
    """The keys would be read as the orders."""
    assert explain_refusal({0: 2, 1: 3}, 2) == ("form", "{0: 2, 1: 3} is no list of orders")
