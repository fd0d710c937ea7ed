"""The model of ratings: Bradley-Terry with draws (Davidson) and a side term, by maximum a posteriori.

Of blue `i` against red `j`, with `d = strength[i] - strength[j] + side`:

    P(blue wins) : P(draw) : P(red wins)  =  exp(d / 2) : exp(draw) : exp(-d / 2)

which is Davidson's model (1970) with nu = exp(draw), and his side term (Davidson and Beaver, 1977). All parameters have weak
normal priors, so that an entry that won or lost everything has a finite rating; the posterior is concave, and Newton's method
climbs it for many leagues at once. Counts are all that goes in, so the order of the games cannot matter.

Parameters stand in one row: the strength of every entry, then `side`, then `draw`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

ELO = 400 / log(10)
"""Elo of one unit of strength."""
PRIOR_STRENGTH, PRIOR_SIDE, PRIOR_DRAW = 4.0, 1.0, 3.0
"""Standard deviations of the priors, all around 0. 4 units are 695 Elo: hardly felt where both sides have won something."""
_MOST_STEPS = 60
_TOLERANCE = 1e-9

Floats = NDArray[np.float64]


def deviations(n_entries: int) -> Floats:
    """Return the standard deviations of the priors, shape (entries + 2,)."""
    return np.array([PRIOR_STRENGTH] * n_entries + [PRIOR_SIDE, PRIOR_DRAW])


def chances(parameters: Floats) -> Floats:
    """Return how likely blue `i` is to beat, draw with and lose to red `j`, shape (entries, entries, 3)."""
    strength, side, draw = parameters[:-2], parameters[-2], parameters[-1]
    half = (strength[:, None] - strength[None, :] + side) / 2
    logits = np.stack([half, np.broadcast_to(draw, half.shape), -half], axis=-1)
    odds = np.exp(logits - logits.max(axis=-1, keepdims=True))
    likely: Floats = odds / odds.sum(axis=-1, keepdims=True)
    return likely


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Links:
    """Priors of differences: of two strengths that are linked, each lies near the other."""

    pairs: Sequence[tuple[int, int]]
    deviation: float
    """Standard deviation of a difference."""

    def __bool__(self) -> bool:
        return bool(self.pairs)

    def differences(self, n_entries: int) -> Floats:
        """Return the matrix that makes of parameters the differences, shape (links, entries + 2)."""
        rows = np.zeros((len(self.pairs), n_entries + 2))
        for row, (one, other) in zip(rows, self.pairs, strict=True):
            row[one], row[other] = -1, 1
        return rows


def fit(
    counts: Floats,
    *,
    start: Floats | None = None,
    means: Floats | None = None,
    links: Links | None = None,
    link_means: Floats | None = None,
) -> Floats:
    """Return the parameters of largest posterior density: strengths, side, draw; shape (draws, entries + 2).

    Parameters
    ----------
    counts
        How often blue `i` beat, drew with and lost to red `j`, shape (draws, entries, entries, 3).
    start
        Where to begin, shape (entries + 2,).
    means
        Of the priors, shape (draws, entries + 2); 0 without it.
    link_means
        Of the differences that are linked, shape (draws, links); 0 without it.
    """
    n_draws, n_entries = counts.shape[:2]
    at = np.tile(np.zeros(n_entries + 2) if start is None else start, (n_draws, 1))
    means = np.zeros_like(at) if means is None else means

    def measure(at: Floats) -> tuple[Floats, Floats, Floats]:
        found = posterior(at, counts, means)
        return _linked(found, at, links, link_means) if links else found

    value, gradient, hessian = measure(at)
    for _ in range(_MOST_STEPS):
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        size = np.ones(n_draws)
        while True:  # halve the steps that do not climb
            there = at + size[:, None] * step
            new_value, new_gradient, new_hessian = measure(there)
            worse = new_value < value - 1e-7 * (1 + abs(value))
            if not worse.any():
                break
            size[worse] /= 2
        at, value, gradient, hessian = there, new_value, new_gradient, new_hessian
        if np.abs(step).max() < _TOLERANCE:
            break
    return at


def posterior(at: Floats, counts: Floats, means: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the log posterior of each draw, its gradient, and its negative Hessian; the arguments are those of `fit`."""
    n_entries = at.shape[1] - 2
    precision = deviations(n_entries) ** -2
    strength, side, draw = at[:, :n_entries], at[:, n_entries, None, None], at[:, n_entries + 1, None, None]
    half = (strength[:, :, None] - strength[:, None, :] + side) / 2
    highest = np.maximum(np.abs(half), draw)
    blue, drawn, red = np.exp(half - highest), np.exp(draw - highest), np.exp(-half - highest)
    total = blue + drawn + red
    won, tied, lost = counts[..., 0], counts[..., 1], counts[..., 2]
    n = won + tied + lost
    off = at - means
    value = ((won - lost) * half + tied * draw - n * (highest + np.log(total))).sum(axis=(1, 2)) - (precision * off**2).sum(
        axis=1
    ) / 2

    lead, tie = (blue - red) / total, drawn / total  # expected points of blue less red's, and the chance of a draw
    by_d = (won - lost - n * lead) / 2
    by_draw = tied - n * tie
    gradient = -precision * off
    gradient[:, :n_entries] += by_d.sum(axis=2) - by_d.sum(axis=1)
    gradient[:, n_entries] += by_d.sum(axis=(1, 2))
    gradient[:, n_entries + 1] += by_draw.sum(axis=(1, 2))

    dd = n * (1 - tie - lead**2) / 4
    dt = -n * lead * tie / 2
    tt = n * tie * (1 - tie)
    hessian = np.zeros((*at.shape, at.shape[1]))
    strengths = hessian[:, :n_entries, :n_entries]
    strengths -= dd + dd.transpose(0, 2, 1)
    places = np.arange(n_entries)
    strengths[:, places, places] += dd.sum(axis=1) + dd.sum(axis=2)
    for row, curve in ((n_entries, dd), (n_entries + 1, dt)):
        hessian[:, row, :n_entries] = curve.sum(axis=2) - curve.sum(axis=1)
        hessian[:, :n_entries, row] = hessian[:, row, :n_entries]
    hessian[:, n_entries, n_entries] = dd.sum(axis=(1, 2))
    hessian[:, n_entries, n_entries + 1] = hessian[:, n_entries + 1, n_entries] = dt.sum(axis=(1, 2))
    hessian[:, n_entries + 1, n_entries + 1] = tt.sum(axis=(1, 2))
    every = np.arange(at.shape[1])
    hessian[:, every, every] += precision
    return value, gradient, hessian


def _linked(
    found: tuple[Floats, Floats, Floats], at: Floats, links: Links, means: Floats | None
) -> tuple[Floats, Floats, Floats]:
    """Add links to a log posterior, its gradient and its negative Hessian."""
    value, gradient, hessian = found
    differences, precision = links.differences(at.shape[1] - 2), links.deviation**-2
    off = at @ differences.T - (0 if means is None else means)
    value = value - precision * (off**2).sum(axis=1) / 2
    return value, gradient - precision * off @ differences, hessian + precision * differences.T @ differences
