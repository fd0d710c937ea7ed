"""Rate entries: Bradley-Terry with draws (Davidson) and a side term, by maximum a posteriori; intervals by bootstrap over pairs.

Of blue `i` against red `j`, with `d = strength[i] - strength[j] + side`:

    P(blue wins) : P(draw) : P(red wins)  =  exp(d / 2) : exp(draw) : exp(-d / 2)

which is Davidson's model (1970) with nu = exp(draw), and his side term (Davidson and Beaver, 1977). All parameters have weak
normal priors, so that an entry that won or lost everything has a finite rating; the posterior is concave, and Newton's method
climbs it for all bootstrap draws at once. Counts are all that goes in, so the order of the games cannot matter.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from arena.game.types import Team
from tournaments.outcome import Outcome
from tournaments.schedule import pair_of

ELO = 400 / log(10)
"""Elo of one unit of strength."""
PRIOR_STRENGTH, PRIOR_SIDE, PRIOR_DRAW = 4.0, 1.0, 3.0
"""Standard deviations of the priors, all around 0. 4 units are 695 Elo: hardly felt where both sides have won something."""
N_DRAWS = 2_000
LEVEL = 0.95
_SEED = 20_031
_MOST_STEPS = 60
_TOLERANCE = 1e-9
_CHUNK = 250
"""Draws climbed at once: more would leave the processor's cache, fewer would leave numpy idle."""

Floats = NDArray[np.float64]
Games = tuple[int, int, int]
"""Blue's entry, red's entry, and 0, 1 or 2: blue won, a draw, red won."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rating:
    """An entry's strength in Elo, 0 being the mean of the league."""

    elo: float
    elo_low: float
    elo_high: float
    rank: int
    """From 1."""
    rank_low: int
    """The better end of the range."""
    rank_high: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratings:
    """All entries, and what the sides and draws are worth."""

    entries: Mapping[str, Rating]
    side_elo: float
    """What playing blue adds."""
    side_elo_low: float
    side_elo_high: float
    draw_rate: float
    """Share of draws between equals."""


def rate(names: Sequence[str], outcomes: Iterable[Outcome], *, n_draws: int = N_DRAWS) -> Ratings:
    """Rate the entries of a league.

    Parameters
    ----------
    names
        Every entry, with matches or without.
    n_draws
        Bootstrap draws behind the intervals; the same every time.
    """
    names = sorted(names)
    index = {name: number for number, name in enumerate(names)}
    pairs: defaultdict[str, list[Games]] = defaultdict(list)
    for outcome in outcomes:
        result = 1 if outcome.winner is None else 0 if outcome.winner is Team.BLUE else 2
        pairs[pair_of(outcome.identity)].append((index[outcome.blue], index[outcome.red], result))
    kinds = Counter(tuple(sorted(games)) for games in pairs.values())
    best = fit(_count(len(names), kinds)[None])[0]
    draws = bootstrap(len(names), kinds, best, n_draws)
    return _summarise(names, best, draws)


def _count(n_entries: int, kinds: Mapping[tuple[Games, ...], int]) -> Floats:
    """Return how often blue `i` did what to red `j`, shape (entries, entries, 3)."""
    counts = np.zeros((n_entries, n_entries, 3))
    for games, n in kinds.items():
        for game in games:
            counts[game] += n
    return counts


def bootstrap(n_entries: int, kinds: Mapping[tuple[Games, ...], int], start: Floats, n_draws: int) -> Floats:
    """Return the parameters of leagues whose pairs were drawn anew with replacement, shape (draws, entries + 2).

    Notes
    -----
    Pairs that went alike are one kind, so drawing pairs is drawing the counts of kinds from a multinomial. They are drawn from
    the whole league, not fixture by fixture: with two pairs in each, the latter would make intervals too small by a third.

    The means of the priors are drawn anew too. Where there are games, that is hardly felt; an entry that only won has nothing
    else to vary, and its interval would be narrower than anybody can know.
    """
    order = sorted(kinds)
    n_pairs = sum(kinds.values())
    rng = np.random.default_rng(_SEED)
    means = rng.normal(size=(n_draws, n_entries + 2)) * _deviations(n_entries)
    means[:, n_entries:] = 0
    if not n_pairs:
        return fit(np.zeros((n_draws, n_entries, n_entries, 3)), means=means)
    shares = np.array([kinds[kind] for kind in order]) / n_pairs
    cells = [(row, game) for row, kind in enumerate(order) for game in kind]
    rows = np.array([row for row, _ in cells])
    places = np.array([np.ravel_multi_index(game, (n_entries, n_entries, 3)) for _, game in cells])
    by_place = np.argsort(places, kind="stable")
    used, begins = np.unique(places[by_place], return_index=True)
    draws = []
    for begin in range(0, n_draws, _CHUNK):
        chosen = means[begin : begin + _CHUNK]
        drawn = rng.multinomial(n_pairs, shares, size=len(chosen)).astype(np.float64)
        counts = np.zeros((len(chosen), n_entries * n_entries * 3))
        counts[:, used] = np.add.reduceat(drawn[:, rows[by_place]], begins, axis=1)
        draws.append(fit(counts.reshape(len(chosen), n_entries, n_entries, 3), start=start, means=chosen))
    return np.concatenate(draws)


def _deviations(n_entries: int) -> Floats:
    return np.array([PRIOR_STRENGTH] * n_entries + [PRIOR_SIDE, PRIOR_DRAW])


def fit(counts: Floats, *, start: Floats | None = None, means: Floats | None = None) -> Floats:
    """Return the parameters of largest posterior density: strengths, side, draw; shape (draws, entries + 2).

    Parameters
    ----------
    counts
        How often blue `i` beat, drew with and lost to red `j`, shape (draws, entries, entries, 3).
    start
        Where to begin, shape (entries + 2,).
    means
        Of the priors, shape (draws, entries + 2); 0 without it.
    """
    n_draws, n_entries = counts.shape[:2]
    at = np.tile(np.zeros(n_entries + 2) if start is None else start, (n_draws, 1))
    means = np.zeros_like(at) if means is None else means
    precision = _deviations(n_entries) ** -2
    value, gradient, hessian = _posterior(at, counts, means, precision)
    for _ in range(_MOST_STEPS):
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        size = np.ones(n_draws)
        while True:  # halve the steps that do not climb
            there = at + size[:, None] * step
            new_value, new_gradient, new_hessian = _posterior(there, counts, means, precision)
            worse = new_value < value - 1e-7 * (1 + abs(value))
            if not worse.any():
                break
            size[worse] /= 2
        at, value, gradient, hessian = there, new_value, new_gradient, new_hessian
        if np.abs(step).max() < _TOLERANCE:
            break
    return at


def _posterior(at: Floats, counts: Floats, means: Floats, precision: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the log posterior of each draw, its gradient, and its negative Hessian."""
    n_entries = at.shape[1] - 2
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


def _summarise(names: Sequence[str], best: Floats, draws: Floats) -> Ratings:
    n_entries = len(names)
    tails = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
    elo = _elo(best[None], n_entries)[0]
    many = _elo(draws, n_entries)
    low, high = np.quantile(many, tails, axis=0)
    rank = rankdata(-elo.round(6), method="min").astype(int)
    rank_low, rank_high = np.quantile(rankdata(-many, axis=1), tails, axis=0, method="nearest").round().astype(int)
    side_low, side_high = np.quantile(draws[:, n_entries] * ELO, tails)
    nu = float(np.exp(best[n_entries + 1]))
    return Ratings(
        entries={
            name: Rating(
                elo=float(elo[i]),
                elo_low=float(min(low[i], elo[i])),
                elo_high=float(max(high[i], elo[i])),
                rank=int(rank[i]),
                rank_low=int(min(rank_low[i], rank[i])),
                rank_high=int(max(rank_high[i], rank[i])),
            )
            for i, name in enumerate(names)
        },
        side_elo=float(best[n_entries] * ELO),
        side_elo_low=float(side_low),
        side_elo_high=float(side_high),
        draw_rate=nu / (nu + 2),
    )


def _elo(parameters: Floats, n_entries: int) -> Floats:
    strengths = parameters[:, :n_entries]
    elo: Floats = ELO * (strengths - strengths.mean(axis=1, keepdims=True))
    return elo
