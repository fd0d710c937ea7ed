"""`assert_never_slower_than` finds the longest turn of a bot in real matches, and is not misled by a busy machine."""

import doctest
import re
from collections.abc import Callable, Iterator, Sequence

import pytest

import arena.testing.speed
from arena import MatchInfo, Observation, Team
from arena.testing import assert_never_slower_than


class Clock:
    """A clock that goes on only where a bot says so."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def thinking(clock: Clock, took_ms: Callable[[Observation], float]) -> Callable[[Observation], Sequence[int]]:
    def act(observation: Observation) -> Sequence[int]:
        clock.now_s += took_ms(observation) / 1000
        return [0 for _ in observation.units]

    return act


def test_the_longest_turn_is_returned_in_milliseconds() -> None:
    clock = Clock()
    act = thinking(clock, lambda seen: 7 if seen.tick == 31 and seen.team is Team.RED else 1)

    assert assert_never_slower_than(act, 8, matches=1, clock=clock) == pytest.approx(7)


def test_a_turn_that_takes_longer_fails_with_its_tick_time_and_match() -> None:
    clock = Clock()
    act = thinking(clock, lambda seen: 7 if seen.tick == 31 and seen.team is Team.RED else 1)

    says = "tick 31 takes 7.0 ms of thinking, the least of 3 plays, as red, rules exp4, seed 5; 6 ms are allowed"
    with pytest.raises(AssertionError, match=re.escape(says)):
        assert_never_slower_than(act, 6, matches=1, clock=clock, rules="exp4", seed=5)


def busy(n_times: int) -> Iterator[float]:
    """Yield the milliseconds of one turn, which is disturbed the first times."""
    yield from [50.0] * n_times
    while True:
        yield 1.0


@pytest.mark.parametrize(("n_times", "is_fast"), [(1, True), (2, True), (3, False)])
def test_a_turn_that_is_disturbed_is_played_again_and_the_least_of_three_counts(n_times: int, is_fast: bool) -> None:
    clock, disturbed = Clock(), busy(n_times)
    act = thinking(clock, lambda seen: next(disturbed) if (seen.tick, seen.team) == (4, Team.BLUE) else 1)

    if is_fast:
        assert assert_never_slower_than(act, 10, matches=1, clock=clock) == pytest.approx(1)
    else:
        with pytest.raises(AssertionError, match=r"tick 4 takes 50\.0 ms"):
            assert_never_slower_than(act, 10, matches=1, clock=clock)


def test_a_bot_with_memory_is_made_anew_and_shown_the_same_when_it_is_played_again() -> None:
    clock = Clock()
    lives: list[list[int]] = []

    class Remembers:
        def start(self, info: MatchInfo) -> None:
            self.seeds: list[int] = []
            lives.append(self.seeds)

        def act(self, observation: Observation) -> Sequence[int]:
            self.seeds.append(observation.seed)
            clock.now_s += 0.05 * (len(self.seeds) == 9 and len(lives) < 4)
            return [0 for _ in observation.units]

    assert_never_slower_than(Remembers, 10, matches=1, clock=clock)

    blue, red, *again = lives
    assert again == [blue, blue, red]
    assert blue != red


def test_against_an_opponent_the_bot_alone_is_measured_on_both_sides_in_turn() -> None:
    clock, sides = Clock(), []

    def act(observation: Observation) -> Sequence[int]:
        if observation.tick == 0:
            sides.append(observation.team)
        return [0 for _ in observation.units]

    assert assert_never_slower_than(act, 1, opponent=thinking(clock, lambda _: 99), matches=3, clock=clock) == 0
    assert sides == [Team.BLUE, Team.RED, Team.BLUE]


def test_it_measures_the_processor_by_default() -> None:
    def act(observation: Observation) -> Sequence[int]:
        total = sum(range(300_000)) if observation.tick == 3 else 0
        return [total * 0 for _ in observation.units]

    with pytest.raises(AssertionError, match=r"^tick 3 takes"):
        assert_never_slower_than(act, 0.5, matches=1)


def test_what_a_bot_raises_reaches_the_test() -> None:
    with pytest.raises(ZeroDivisionError):
        assert_never_slower_than(lambda _: 1 / 0, 10)


def test_the_example_in_the_docstring_holds() -> None:
    done = doctest.testmod(arena.testing.speed)

    assert (done.failed, done.attempted > 0) == (0, True)
