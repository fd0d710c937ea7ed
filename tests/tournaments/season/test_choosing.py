"""Which pairs a season plays next, in made-up leagues whose truth is known."""

from collections.abc import Callable, Sequence
from math import log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import spearmanr

from arena.intervals import Z95
from tournaments.ratings.davidson import ELO, Floats, chances
from tournaments.ratings.normal import Posterior, fit_counts
from tournaments.season.choosing import MOST_AS_NEWCOMER, NEWCOMER_ELO, REPEATS, Player, choose_pairs

Pairs = list[tuple[int, int]]
Choice = Callable[["League", int, np.random.Generator], Pairs]
DRAW = log(2 / 9)
SIDE = 20 / ELO


class League:
    """Entries of known strengths, and what they have played."""

    def __init__(self, strengths: Floats, owners: Sequence[str] | None = None) -> None:
        self.n = len(strengths)
        self.strengths = strengths
        self.players = [Player(label=str(number), owner=owners[number] if owners else "") for number in range(self.n)]
        self.chances = chances(np.array([*strengths, SIDE, DRAW]))
        self.counts = np.zeros((self.n, self.n, 3))
        self._known: Posterior | None = None
        self.n_played: NDArray[np.int64] = np.zeros((self.n, self.n), dtype=np.int64)

    def play(self, pairs: Pairs, rng: np.random.Generator, n_times: int = 1) -> None:
        for one, other in pairs:
            for blue, red in ((one, other), (other, one)):
                self.counts[blue, red] += rng.multinomial(n_times, self.chances[blue, red])
                self.n_played[blue, red] += n_times

    def estimate(self) -> Posterior:
        self._known = fit_counts(self.counts, start=self._known)
        return self._known

    def width_elo(self, player: int) -> float:
        """Return the width of a 95% interval."""
        _, covariance = self.estimate().centred
        return float(2 * Z95 * covariance[player, player] ** 0.5)

    def order(self) -> float:
        """Return how near the order is to the truth."""
        return float(spearmanr(self.estimate().strengths, self.strengths).statistic)


def by_what_tells_most(league: League, n_pairs: int, rng: np.random.Generator) -> Pairs:
    return choose_pairs(league.players, league.estimate(), league.n_played, n_pairs, rng)


def at_random(league: League, n_pairs: int, rng: np.random.Generator) -> Pairs:
    return [(int(one), int(other)) for one, other in (rng.choice(league.n, 2, replace=False) for _ in range(n_pairs))]


def of_nearest_ratings(league: League, n_pairs: int, rng: np.random.Generator) -> Pairs:
    strengths = league.estimate().strengths
    pairs: Pairs = []
    for one in map(int, rng.integers(league.n, size=n_pairs)):
        gaps = abs(strengths - strengths[one]) + 0.2 * rng.random(league.n)
        gaps[one] = np.inf
        pairs.append((one, int(gaps.argmin())))
    return pairs


def draw_league(n: int, rng: np.random.Generator) -> League:
    return League(rng.normal(0, 200 / ELO, n))


def settle(league: League, newcomer: int, rng: np.random.Generator, n_times: int = 10) -> None:
    """Have all but a newcomer play each other."""
    others = [number for number in range(league.n) if number != newcomer]
    league.play([(one, other) for one in others for other in others if one < other], rng, n_times)


def count_until_known(newcomer: int, choose: Choice, league: League, rng: np.random.Generator) -> int:
    """Return how many pairs a newcomer plays until its interval is as narrow as it should be."""
    while league.width_elo(newcomer) > NEWCOMER_ELO:
        league.play(choose(league, 4, rng), rng)
        assert league.n_played[newcomer].sum() < 1_000
    return int(league.n_played[newcomer].sum())


def test_a_newcomer_among_forty_is_known_after_few_pairs(size: Callable[[int, int], int]) -> None:
    """A pair says most of two equals: 103 against opponents that are known for sure would do."""

    def against_anyone(league: League, n_pairs: int, rng: np.random.Generator) -> Pairs:
        return [(0, int(other)) for other in 1 + rng.integers(league.n - 1, size=n_pairs)]

    needed: dict[Choice, list[int]] = {by_what_tells_most: [], against_anyone: []}
    for seed in range(size(4, 50)):
        for choose, found in needed.items():
            rng = np.random.default_rng(seed)
            league = draw_league(40, rng)
            settle(league, 0, rng)
            found.append(count_until_known(0, choose, league, rng))
    ours, random = (np.array(found) for found in needed.values())

    assert np.median(ours) <= 120
    assert (ours <= random + 10).all()
    assert ours.mean() < 0.9 * random.mean()


def test_the_order_of_forty_is_nearer_the_truth_than_after_as_many_other_pairs(size: Callable[[int, int], int]) -> None:
    found: dict[Choice, list[float]] = {by_what_tells_most: [], at_random: [], of_nearest_ratings: []}
    for seed in range(size(6, 50)):
        for choose, orders in found.items():
            rng = np.random.default_rng(seed)
            league = draw_league(40, rng)
            for _ in range(15):  # 15 pairs an entry
                league.play(choose(league, 20, rng), rng)
            orders.append(league.order())

    ours, *theirs = (np.mean(orders) for orders in found.values())
    assert ours > max(theirs) + 0.005


def test_the_pair_that_is_chosen_is_the_one_after_which_a_newcomer_is_known_best() -> None:
    """An oracle: the information matrix inverted anew for every pair there is."""
    rng = np.random.default_rng(3)
    league = draw_league(6, rng)
    settle(league, 2, rng, n_times=40)
    league.play([(2, 0), (2, 5), (2, 4)], rng)
    known = league.estimate()

    def variance_after(one: int, other: int) -> float:
        e = np.zeros(6)
        e[one], e[other] = 1.0, -1.0
        d, v = e @ known.strengths, e @ known.covariance[:6, :6] @ e
        flat = (1 + np.pi * v / 8) ** -0.5
        information = 0.0
        for half in (float(flat * (d + side) / 2) for side in (known.side, -known.side)):
            odds = np.exp(np.array([half, known.draw, -half]))
            blue, drawn, red = odds / odds.sum()
            information += flat * (1 - drawn - (blue - red) ** 2) / 4
        off = (60 / ELO) ** 2
        information /= (1 + league.n_played[one, other] * information * off) ** 2
        after = np.linalg.inv(np.linalg.inv(known.covariance[:6, :6]) + information * np.outer(e, e))
        centre = np.eye(6) - 1 / 6
        return float((centre @ after @ centre)[2, 2])

    couples = [(one, other) for one in range(6) for other in range(one + 1, 6) if (one, other) not in ((0, 2), (2, 5), (2, 4))]
    [chosen] = choose_pairs(league.players, known, league.n_played, 1, rng)

    assert tuple(sorted(chosen)) == min(couples, key=lambda couple: variance_after(*couple))


def test_a_batch_for_a_newcomer_is_against_many() -> None:
    rng = np.random.default_rng(0)
    league = draw_league(20, rng)
    settle(league, 7, rng)

    batch = by_what_tells_most(league, 12, rng)

    assert all(7 in pair for pair in batch)
    assert len({frozenset(pair) for pair in batch}) == 12


def test_a_batch_of_those_of_whom_nothing_is_known_busies_everyone_alike() -> None:
    league = League(np.zeros(20))

    batch = by_what_tells_most(league, 10, np.random.default_rng(0))

    assert sorted(player for pair in batch for player in pair) == list(range(20))


def test_pairs_under_way_are_not_chosen_again() -> None:
    rng = np.random.default_rng(0)
    league = draw_league(20, rng)
    settle(league, 7, rng)
    known = league.estimate()

    first = choose_pairs(league.players, known, league.n_played, 6, rng)
    then = choose_pairs(league.players, known, league.n_played, 6, rng, under_way=first)

    assert not {frozenset(pair) for pair in first} & {frozenset(pair) for pair in then}


def test_whoever_loses_every_match_does_not_keep_everyone_busy() -> None:
    rng = np.random.default_rng(0)
    league = League(np.array([-50.0, *rng.normal(0, 1, 11)]))
    settle(league, 0, rng, n_times=40)

    while league.n_played[0].sum() < MOST_AS_NEWCOMER:
        league.play(by_what_tells_most(league, 20, rng), rng)
    batch = by_what_tells_most(league, 20, rng)

    assert league.width_elo(0) > NEWCOMER_ELO
    assert sum(0 in pair for pair in batch) <= 5


def test_repetitions_are_bounded() -> None:
    rng = np.random.default_rng(0)
    league = League(np.array([0.0, 0.0, *np.linspace(-4, 4, 18)]))
    for _ in range(60):
        league.play(by_what_tells_most(league, 10, rng), rng)
    each = league.n_played.sum(axis=1) / 19

    assert (league.n_played <= 2 + REPEATS * np.minimum(each[:, None], each[None, :])).all()


@given(st.lists(st.sampled_from(["", "ann", "bob"]), min_size=2, max_size=8), st.integers(1, 30), st.integers(0, 99))
def test_two_of_one_owner_never_meet_and_else_nobody_is_left_without(owners: list[str], n_pairs: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    league = League(rng.normal(0, 1, len(owners)), owners)
    can_play = len(set(owners)) > 1 or owners[0] == ""

    chosen = by_what_tells_most(league, n_pairs, rng)

    assert len(chosen) == (n_pairs if can_play else 0)
    assert all(one != other for one, other in chosen)
    assert all(not owners[one] or owners[one] != owners[other] for one, other in chosen)


def test_the_same_generator_chooses_the_same_pairs() -> None:
    league = draw_league(10, np.random.default_rng(0))

    first, again, other = (by_what_tells_most(league, 20, np.random.default_rng(seed)) for seed in (1, 1, 2))

    assert first == again != other


def test_a_table_of_other_players_is_the_callers_mistake() -> None:
    league = draw_league(4, np.random.default_rng(0))

    with pytest.raises(ValueError, match="for 3 players"):
        choose_pairs(league.players[:3], league.estimate(), league.n_played, 1, np.random.default_rng(0))
