"""Which pairs a season plays next: those that are expected to tell most about its table. Pure: a generator breaks ties.

What is known of the table is a normal distribution over strengths. A pair of matches between `i` and `j`, with Fisher information
`I` about their difference, takes from the covariance `S`

    I u u' / (1 + I v),   u = S (e_i - e_j),   v = (e_i - e_j)' S (e_i - e_j)

whatever its result. So what a pair is worth can be computed before it is played, and a batch is chosen greedily: each pair as if
the ones before it had been played. Worth is

- while there are newcomers, how much the variance of their ratings falls;
- else how much the expected error of the order falls, summed over all couples: by how much the one that stands lower may be the
  stronger one. For a difference `d` of variance `v` that is `sqrt(v) phi(z) - |d| Phi(-z)` with `z = |d| / sqrt(v)`, and its
  derivative by `v` is `phi(z) / (2 sqrt(v))`.

Pairs of near opponents tell more than others. But a rating won against a few opponents alone says less of all the others, so each
repetition of a fixture is worth less than the one before (`FIXTURE_ELO`), and repetitions have a bound (`REPEATS`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arena.intervals import Z95
from tournaments.ratings.davidson import ELO, Floats
from tournaments.ratings.normal import Posterior

NEWCOMER_ELO = 100.0
"""Whoever has a wider 95% interval, and has played less than most, is a newcomer, ..."""
NEWCOMER_RATIO = 1.25
"""... if it is wider than most by this as well: at the beginning of a season there are no newcomers."""
MOST_AS_NEWCOMER = 200
"""Pairs; whoever loses every match keeps a wide interval, and must not keep everyone busy for ever."""
FIXTURE_ELO = 60.0
"""Standard deviation of what two entries' scores against each other are off, from what their ratings say."""
REPEATS = 5.0
"""So many times as often as its opponents on average, an entry meets one of them, at most."""
_LEAST_VARIANCE = 1e-12
_WIDTH = 2 * Z95 * ELO
"""Of a 95% interval in Elo, for a standard deviation of 1 unit."""

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Player:
    """An entry's current version, as far as it matters for whom it meets."""

    label: str
    owner: str = ""
    """Two of one owner never meet; the organiser's own, whose owner is empty, do."""


def choose_pairs(
    players: Sequence[Player],
    posterior: Posterior,
    n_played: Ints,
    n_pairs: int,
    rng: np.random.Generator,
    under_way: Sequence[tuple[int, int]] = (),
) -> list[tuple[int, int]]:
    """Return which pairs are to be played next, the one that tells most first.

    Parameters
    ----------
    posterior
        What is known of the players' strengths, in their order.
    n_played
        Pairs that any two have played, shape (players, players), symmetric.
    n_pairs
        How many to choose; fewer come back only where no two may meet.
    rng
        Decides between pairs that are worth the same, and which of a pair is named first.
    under_way
        Pairs whose results the posterior does not know yet.
    """
    table = _Table(players, posterior, n_played)
    for one, other in under_way:
        table.assume(one, other)
    chosen: list[tuple[int, int]] = []
    while len(chosen) < n_pairs:
        pair = table.find_best(rng)
        if pair is None:
            break
        table.assume(*pair)
        chosen.append(pair if rng.random() < 0.5 else pair[::-1])
    return chosen


class _Table:
    """What is known of a table, and what would be, if more pairs were played."""

    def __init__(self, players: Sequence[Player], posterior: Posterior, n_played: Ints) -> None:
        n = len(players)
        if n_played.shape != (n, n) or posterior.strengths.shape != (n,) or not np.array_equal(n_played, n_played.T):
            raise ValueError(f"for {n} players, strengths and a symmetric table of pairs are needed")
        owners = np.array([player.owner or f"\0{number}" for number, player in enumerate(players)])
        may_meet = owners[:, None] != owners[None, :]
        self._ones, self._others = np.nonzero(np.triu(may_meet, 1))
        """Of every couple that may meet, the two."""
        self._n_opponents = np.maximum(may_meet.sum(axis=1), 1)
        self._n_pairs = n_played.sum(axis=1).astype(np.float64)
        self._n_repeats = n_played[self._ones, self._others].astype(np.float64)
        # Around the mean, as ratings are shown: differences, all that a match tells of, stay what they are.
        self._covariance = posterior.centred[1] / ELO**2
        self._variances = self._spread(self._covariance)
        """Of every couple's difference."""
        self._strengths = posterior.strengths
        differences = posterior.strengths[self._ones] - posterior.strengths[self._others]
        self._information = _expect_information(differences, self._variances, posterior.side, posterior.draw)
        self._newcomers = np.zeros(n, dtype=bool)
        self._weights: Floats | None = None
        """The matrix `W`: what the table is worth is `-trace(W covariance)`."""
        self._worths = np.zeros_like(differences)
        """Of every couple, `(e_i - e_j)' S W S (e_i - e_j)`."""

    def _spread(self, matrix: Floats) -> Floats:
        """Return of every couple `(e_i - e_j)' matrix (e_i - e_j)`."""
        diagonal = np.diag(matrix)
        found: Floats = diagonal[self._ones] + diagonal[self._others] - 2 * matrix[self._ones, self._others]
        return found

    def assume(self, one: int, other: int) -> None:
        """Know what will be known when two have played a pair more."""
        couple = int(np.flatnonzero((self._ones == min(one, other)) & (self._others == max(one, other)))[0])
        u = self._covariance[:, one] - self._covariance[:, other]
        information = self._discounted()[couple]
        factor = information / (1 + information * self._variances[couple])
        du = u[self._ones] - u[self._others]
        if self._weights is not None:
            g = self._covariance @ (self._weights @ u)
            self._worths += factor * du * (factor * self._worths[couple] * du - 2 * (g[self._ones] - g[self._others]))
        self._variances -= factor * du**2
        self._covariance -= np.outer(factor * u, u)
        self._n_repeats[couple] += 1
        self._n_pairs[[one, other]] += 1

    def find_best(self, rng: np.random.Generator) -> tuple[int, int] | None:
        """Return the pair that is worth most; None if no two may meet."""
        if not len(self._ones):
            return None
        newcomers = self._find_newcomers()
        if self._weights is None or not np.array_equal(newcomers, self._newcomers):
            self._newcomers = newcomers
            self._weights = np.diag(newcomers.astype(np.float64)) if newcomers.any() else self._weigh_order()
            self._worths = self._spread(self._covariance @ self._weights @ self._covariance)
        information = self._discounted()
        gains = information * self._worths / (1 + information * self._variances)
        gains *= 1 + 1e-6 * rng.random(len(gains))
        each = self._n_pairs / self._n_opponents
        is_free = self._n_repeats < 1 + REPEATS * np.minimum(each[self._ones], each[self._others])
        best = int(np.where(is_free, gains, -np.inf).argmax())
        return int(self._ones[best]), int(self._others[best])

    def _find_newcomers(self) -> NDArray[np.bool_]:
        widths = _WIDTH * np.sqrt(np.diag(self._covariance))
        is_wide = widths > max(NEWCOMER_ELO, NEWCOMER_RATIO * float(np.median(widths)))
        return np.asarray(is_wide & (self._n_pairs < min(MOST_AS_NEWCOMER, float(np.median(self._n_pairs)))))

    def _discounted(self) -> Floats:
        """Return of every couple what one more pair says of their ratings.

        Of `n` pairs, each of information `I`, a fixture with a variance `a` of its own says `1 / (a + 1 / n I)`; this is the
        derivative by `n`.
        """
        off = (FIXTURE_ELO / ELO) ** 2
        found: Floats = self._information / (1 + self._n_repeats * self._information * off) ** 2
        return found

    def _weigh_order(self) -> Floats:
        """Return the `W` of the expected error of the order."""
        difference = self._strengths[self._ones] - self._strengths[self._others]
        weights = np.zeros_like(self._covariance)
        variances = np.maximum(self._variances, _LEAST_VARIANCE)
        weights[self._ones, self._others] = np.exp(-(difference**2) / variances / 2) / np.sqrt(variances)
        weights += weights.T
        laplacian: Floats = np.diag(weights.sum(axis=1)) - weights
        return laplacian


def _expect_information(differences: Floats, variances: Floats, side: float, draw: float) -> Floats:
    """Return the Fisher information of pairs about differences that are themselves known with a variance only.

    The mean of a logistic curve over a normal distribution is nearly the same curve, flatter by `1 / sqrt(1 + pi v / 8)`.
    """
    flat = 1 / np.sqrt(1 + np.pi / 8 * variances)
    total = np.zeros_like(differences)
    for lead in (side, -side):
        half = flat * np.abs(differences + lead) / 2
        odds, drawn = np.exp(-2 * half), np.exp(draw - half)
        whole = 1 + odds + drawn
        total += flat * (1 - drawn / whole - ((1 - odds) / whole) ** 2) / 4
    return total
