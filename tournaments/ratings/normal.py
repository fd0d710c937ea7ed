"""Ratings without a bootstrap: one fit of Davidson's model, and the normal distribution that its curvature at the top describes.

The covariance of the parameters is the inverse of the negative Hessian `H` of the log posterior (Laplace), as if every match were
independent. The two matches of a pair share a map, and need not be: with `v` and `w` the variances of the points in both under
the model, and `rho` their correlation as one entry sees them,

    C = H^-1 (H + sum over pairs of 2 rho sqrt(v w) (u u' - e e')) H^-1

where `u` is +1 and -1 at the two entries, and `e` is 1 at the side. That is the sandwich over pairs of generalised estimating
equations (Liang and Zeger, 1986), with one correlation for the whole league. The squares of the residuals themselves, the usual
filling, were left out: an entry that won everything has none, and its interval would say that nobody can beat it. Maps that
favour a side make `rho` negative, and strengths the more certain.

A fit of 200 entries takes some 50 ms however many matches there are, so a season is rated anew after every match.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tournaments.ratings.bootstrap import Unit
from tournaments.ratings.davidson import ELO, Floats, Links, chances, fit, posterior
from tournaments.ratings.links import choose_links

_POINTS = np.array([1, 0.5, 0])
"""Blue's, where blue won, drew and lost."""
_FEW = 1.0
"""Variance of points that speaks for independent matches before any pair was seen: four pairs of even matches."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posterior:
    """What is known of a league's parameters: a normal distribution. In units of strength: `ELO` is what one is worth."""

    strengths: Floats
    """Shape (entries,); only their differences mean anything."""
    side: float
    draw: float
    covariance: Floats
    """Of strengths, side and draw, shape (entries + 2, entries + 2)."""
    links: Links | None = None
    """Between versions, if there are any that the data favour."""

    @property
    def parameters(self) -> Floats:
        """Strengths, side and draw in one row, as `davidson` has them."""
        return np.array([*self.strengths, self.side, self.draw])

    @property
    def centred(self) -> tuple[Floats, Floats]:
        """Elo around the league's mean, shape (entries,), and its covariance."""
        return self.centre(np.ones(len(self.strengths)))

    def centre(self, weights: Floats) -> tuple[Floats, Floats]:
        """Return Elo around a weighted mean, shape (entries,), and its covariance."""
        n = len(self.strengths)
        centre = np.eye(n) - weights / weights.sum()
        return ELO * centre @ self.strengths, ELO**2 * centre @ self.covariance[:n, :n] @ centre.T

    @property
    def difference_deviations(self) -> Floats:
        """Standard deviation of each difference of two strengths, shape (entries, entries)."""
        n = len(self.strengths)
        variance = np.diag(self.covariance)[:n]
        squares = variance[:, None] + variance[None, :] - 2 * self.covariance[:n, :n]
        deviations: Floats = np.sqrt(np.maximum(squares, 0))
        return deviations


def fit_counts(
    counts: Floats,
    pairs: Mapping[Unit, int] | None = None,
    *,
    follows: Sequence[tuple[int, int]] = (),
    start: Posterior | None = None,
) -> Posterior:
    """Return the posterior of a league.

    Parameters
    ----------
    counts
        How often blue `i` beat, drew with and lost to red `j`, shape (entries, entries, 3).
    pairs
        How often each kind of pair was seen, of the same matches; without them, matches are independent.
    follows
        Each version of an entry that has one after it, and that one; see `links`.
    start
        An earlier posterior of the same entries, from which the fit is nearer.
    """
    known = _fit(counts, pairs, None, None if start is None else start.parameters)
    links = choose_links(known.strengths, known.difference_deviations, follows)
    return _fit(counts, pairs, links, known.parameters) if links else known


def _fit(counts: Floats, pairs: Mapping[Unit, int] | None, links: Links | None, start: Floats | None) -> Posterior:
    n = len(counts)
    best = fit(counts[None], start=start, links=links)[0]
    hessian = posterior(best[None], counts[None], np.zeros((1, n + 2)))[2][0]
    if links:
        differences = links.differences(n)
        hessian = hessian + links.deviation**-2 * differences.T @ differences
    covariance = np.linalg.inv(hessian)
    if pairs:
        covariance = covariance + covariance @ _shared(best, covariance, pairs) @ covariance
    return Posterior(
        strengths=best[:n],
        side=float(best[n]),
        draw=float(best[n + 1]),
        covariance=(covariance + covariance.T) / 2,
        links=links,
    )


def _shared(best: Floats, covariance: Floats, pairs: Mapping[Unit, int]) -> Floats:
    """Return what pairs add to the variance of the posterior's gradient, shape (entries + 2, entries + 2)."""
    n = len(best) - 2
    shares = chances(best)
    expected = shares @ _POINTS
    variance = shares @ _POINTS**2 - expected**2
    whole = sorted((pair, times) for pair, times in pairs.items() if len(pair) == 2)  # the last bits of sums depend on it
    shared = np.zeros((n + 2, n + 2))
    if not whole:
        return shared
    games = np.array([pair for pair, _ in whole])  # (kinds, 2, 3)
    times = np.array([float(times) for _, times in whole])
    blue, red, result = games[..., 0], games[..., 1], games[..., 2]
    off = (_POINTS[result] - expected[blue, red]) * np.where(blue == blue[:, :1], 1, -1)  # in points of the first game's blue
    v, w = variance[blue, red].T
    i, j = blue[:, 0], red[:, 0]
    spread = covariance[i, i] + covariance[j, j] - 2 * covariance[i, j] - covariance[n, n]
    both = np.sqrt(v * w)
    seen = (
        times * (off.prod(axis=1) + v * w * spread)
    ).sum()  # the fit followed the residuals: v w spread of each product is gone
    rho = float(np.clip(seen / ((times * both).sum() + _FEW), -1, 1))
    weight = np.zeros((n, n))
    np.add.at(weight, (i, j), 2 * rho * times * both)
    weight += weight.T
    shared[:n, :n] = np.diag(weight.sum(axis=1)) - weight
    shared[n, n] = -weight.sum() / 2
    return shared
