"""Fixtures: who plays whom on which map, and how it is counted."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, philox_keys, secret_from_seed
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team, Termination
from arena.local.venue import MatchRecord
from arena.policy import Faults, MatchResult
from arena.records.plan import MatchPlan
from tournaments.fixture import Tally, plan_fixture, tally

SECRET = secret_from_seed(7)


def record(
    pair: int, blue: str, red: str, winner: Team | None, score: int = 0, faults: tuple[Faults, Faults] | None = None
) -> MatchRecord:
    """Return a match of the fixture of `a` and `b`, as it might have been played."""
    keys = MatchKeys(map_key=pair.to_bytes(32, "big"), match_key=bytes(32))
    ending = Termination.TICK_LIMIT if winner is None else Termination.CAPTURE
    return MatchRecord(
        plan=MatchPlan(identity=f"{pair}/{blue}", blue=blue, red=red, keys=keys),
        result=MatchResult(ending=ending, winner=winner, score=score, ticks=10),
        faults=faults or (Faults(), Faults()),
        n_unreadable=(0, 0),
        journal=None,
    )


def pair_of(number: int, as_blue: Team | None, as_red: Team | None) -> list[MatchRecord]:
    """Return a pair of `a` and `b`: who won the leg in which `a` is blue, and who the other."""
    return [record(number, "a", "b", as_blue), record(number, "b", "a", as_red)]


def starts(plans: list[MatchPlan], ruleset: Ruleset) -> BatchedGame:
    games = BatchedGame(ruleset, len(plans))
    games.start(range(len(plans)), [plan.keys for plan in plans])
    return games


def test_each_map_is_played_from_both_sides() -> None:
    plans = plan_fixture("league", "a", "b", 3, SECRET)

    assert [(plan.blue, plan.red) for plan in plans] == [("a", "b"), ("b", "a")] * 3
    assert [plan.keys.map_key for plan in plans[::2]] == [plan.keys.map_key for plan in plans[1::2]]
    assert len({plan.keys.map_key for plan in plans}) == 3


@pytest.mark.parametrize("name", ["paper", "mirror", "exp1"])
def test_legs_of_a_pair_begin_on_the_same_board(name: str) -> None:
    plans = plan_fixture("league", "a", "b", 8, SECRET)
    state = starts(plans, load(name)).state

    assert (state.ground[::2] == state.ground[1::2]).all()
    assert (state.cell[::2] == state.cell[1::2]).all()
    assert len(np.unique(state.ground[::2], axis=0)) == 8


def test_legs_of_a_pair_share_nothing_but_the_map() -> None:
    plans = plan_fixture("league", "a", "b", 8, SECRET)
    drawn = philox_keys([plan.keys for plan in plans])
    keys = [words.tobytes() for words in (*drawn.unit.reshape(-1, 2), *drawn.seat.reshape(-1, 2))]

    assert len({plan.keys.match_key for plan in plans}) == len(plans)
    assert len(set(keys)) == len(keys)


@given(st.data())
def test_no_two_matches_share_an_identity_or_a_key(data: st.DataObject) -> None:
    names = data.draw(
        st.lists(
            st.text(st.characters(exclude_categories=["Cs"], exclude_characters="/"), max_size=8),
            min_size=4,
            max_size=4,
            unique=True,
        )
    )
    plans = [
        plan
        for one, other in ((0, 1), (0, 2), (3, 1))
        for plan in plan_fixture("league", names[one], names[other], data.draw(st.integers(1, 3)), SECRET)
    ]

    assert len({plan.keys.match_key for plan in plans}) == len({plan.identity for plan in plans}) == len(plans)


def test_another_secret_gives_other_keys() -> None:
    one, other = (plan_fixture("league", "a", "b", 2, secret_from_seed(seed)) for seed in (1, 2))

    assert not {plan.keys.map_key for plan in one} & {plan.keys.map_key for plan in other}
    assert not {plan.keys.match_key for plan in one} & {plan.keys.match_key for plan in other}
    assert [plan.identity for plan in one] == [plan.identity for plan in other]


def test_more_pairs_begin_with_the_same_ones() -> None:
    assert plan_fixture("league", "a", "b", 5, SECRET)[:4] == plan_fixture("league", "a", "b", 2, SECRET)


def test_it_counts_from_the_first_entry_s_side() -> None:
    records = [*pair_of(0, Team.BLUE, Team.RED), *pair_of(1, Team.BLUE, Team.BLUE), *pair_of(2, None, Team.BLUE)]

    counted = tally("a", "b", records)

    assert (counted.wins, counted.draws, counted.losses) == (3, 1, 2)
    assert counted.score == pytest.approx(3.5 / 6)
    assert (counted.blue_wins, counted.red_wins) == (4, 1)
    assert (counted.ticks, counted.endings) == (60, {"capture": 5, "tick_limit": 1})


def test_the_mean_score_of_the_game_is_the_first_entry_s() -> None:
    counted = tally("a", "b", [record(0, "a", "b", Team.BLUE, 100), record(0, "b", "a", Team.BLUE, 40)])

    assert counted.mean_game_score == 30


@given(st.permutations([*pair_of(0, Team.BLUE, Team.RED), *pair_of(1, Team.BLUE, None), *pair_of(2, Team.RED, Team.BLUE)]))
def test_the_order_of_matches_does_not_count(records: list[MatchRecord]) -> None:
    assert tally("a", "b", records) == tally("a", "b", sorted(records, key=lambda record: record.plan.identity))


def swapped(counted: Tally) -> dict[str, Any]:
    return {
        "wins": counted.losses,
        "losses": counted.wins,
        "draws": counted.draws,
        "score": pytest.approx(1 - counted.score),
        "low": pytest.approx(1 - counted.score_high),
        "high": pytest.approx(1 - counted.score_low),
    }


@given(st.lists(st.tuples(*[st.sampled_from([Team.BLUE, Team.RED, None])] * 2), min_size=1, max_size=12))
def test_both_sides_count_alike(legs: list[tuple[Team | None, Team | None]]) -> None:
    records = [leg for number, (one, other) in enumerate(legs) for leg in pair_of(number, one, other)]
    counted, mirrored = tally("a", "b", records), tally("b", "a", records)

    assert swapped(counted) == {
        "wins": mirrored.wins,
        "losses": mirrored.losses,
        "draws": mirrored.draws,
        "score": mirrored.score,
        "low": mirrored.score_low,
        "high": mirrored.score_high,
    }
    assert 0 <= counted.score_low <= counted.score <= counted.score_high <= 1
    assert counted.wins + counted.draws + counted.losses == 2 * len(legs)


def test_the_interval_is_over_pairs() -> None:
    """A hundred maps that blue always wins say nothing about who is better, and say so nearly as surely as can be."""
    split = tally("a", "b", [leg for number in range(100) for leg in pair_of(number, Team.BLUE, Team.BLUE)])

    assert (split.score, split.score_low, split.score_high) == (
        0.5,
        pytest.approx(0.4705, abs=1e-4),
        pytest.approx(0.5295, abs=1e-4),
    )


@pytest.mark.parametrize(("n_pairs", "low"), [(2, 0.2236), (10, 0.7411), (100, 0.9705)])
def test_pairs_that_are_all_won_leave_room_for_one_that_is_not(n_pairs: int, low: float) -> None:
    """With a chance of `low` to win a pair, so many are won in a row in 5% of cases."""
    won = tally("a", "b", [leg for number in range(n_pairs) for leg in pair_of(number, Team.BLUE, Team.RED)])

    assert (won.score, won.score_low, won.score_high) == (1.0, pytest.approx(low, abs=1e-4), 1.0)


def test_one_pair_says_nothing_about_the_interval() -> None:
    counted = tally("a", "b", pair_of(0, Team.BLUE, Team.RED))

    assert (counted.score, counted.score_low, counted.score_high) == (1.0, 0.0, 1.0)


def test_the_interval_narrows_as_pairs_are_played() -> None:
    def width(n_pairs: int) -> float:
        records = [leg for number in range(n_pairs) for leg in pair_of(number, Team.BLUE, Team.RED if number % 2 else Team.BLUE)]
        counted = tally("a", "b", records)
        return counted.score_high - counted.score_low

    assert width(400) == pytest.approx(width(100) / 2, rel=0.01)
    assert width(400) == pytest.approx(2 * 1.96 * 0.25 / 20, rel=0.01)


def test_faults_are_added_by_entry_and_the_first_traceback_is_kept() -> None:
    records = [
        record(0, "a", "b", None, faults=(Faults(raised=2, first_traceback="first"), Faults(illegal=1))),
        record(1, "b", "a", None, faults=(Faults(illegal=4), Faults(raised=1, first_traceback="second"))),
    ]

    assert tally("a", "b", records[::-1]).faults == {
        "a": Faults(raised=3, first_traceback="first"),
        "b": Faults(illegal=5),
    }


def test_two_names_are_enough_for_any_number_of_pairs(size: Callable[[int, int], int]) -> None:
    n_pairs = size(500, 20_000)

    assert len({plan.identity for plan in plan_fixture("league", "a", "b", n_pairs, SECRET)}) == 2 * n_pairs
