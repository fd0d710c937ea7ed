"""How far the truth could lie from a league's parameters: fit them again to many leagues that could have been played as well.

What is drawn anew is the independent unit: a pair, whose two matches share a map, or a match, where each has a map of its own.

The draws are those of the Bayesian bootstrap (Rubin, 1981): a unit counts not 0, 1, 2 times but with a weight, the weights being
uniform among all that have the right sum. Units that went alike are one kind, and a kind seen k times gets Gamma(k). Its mean and
variance are those of drawing with replacement, but what was seen once never vanishes from a draw.

What was never seen has no weight in any bootstrap: an entry that won everything wins everything in every draw, and its interval
would say that nobody can beat it. So the league is cut in two in every way that matters: an entry against all others, those of a
strength and above against those below. In each draw each half wins a little more off the other: Gamma(1/2) in all, which falls on
the cut's games as the fitted model finds such wins likely. Where k of n results went against the grain, that makes Gamma(k + 1/2)
against Gamma(n - k + 1/2), which is Jeffreys' interval for a share, and covers at 0 of n too (Brown, Cai and DasGupta, 2001,
"Interval estimation for a binomial proportion"). Where k is large, nobody notices. How far up the interval of such an entry
reaches is for the prior to say: no result speaks against any height.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from arena.game.types import Team
from tournaments.outcome import Outcome
from tournaments.ratings.davidson import Floats, Links, chances, deviations, fit

Game = tuple[int, int, int]
"""Blue's entry, red's entry, and 0, 1 or 2: blue won, a draw, red won."""
Unit = tuple[Game, ...]
"""BatchedGame that only come together."""
_SEED = 20_031
_CHUNK = 250
"""Draws climbed at once: more would leave the processor's cache, fewer would leave numpy idle."""
UNSEEN = 0.5
"""Shape of the weight of what was not seen: Jeffreys' prior."""
_SAME = 1e-6
"""Strengths this close are the same."""


def game_of(outcome: Outcome, index: Mapping[str, int]) -> Game:
    """Return a match as a game; `index` has each entry's number."""
    return index[outcome.blue], index[outcome.red], round(2 - 2 * outcome.result.points(Team.BLUE))


def count(n_entries: int, kinds: Mapping[Unit, int]) -> Floats:
    """Return how often blue `i` beat, drew with and lost to red `j`, shape (entries, entries, 3)."""
    counts = np.zeros((n_entries, n_entries, 3))
    for games, n in kinds.items():
        for game in games:
            counts[game] += n
    return counts


def bootstrap(
    n_entries: int, strata: Iterable[Mapping[Unit, int]], best: Floats, n_draws: int, links: Links | None = None
) -> Floats:
    """Return the parameters of leagues whose units were drawn anew, shape (draws, entries + 2); the same every time.

    Parameters
    ----------
    strata
        How often each kind of unit was seen. Every draw has as many units of a stratum as were played: one stratum for pairs, two
        for matches, by side.
    best
        Parameters fitted to what was played, shape (entries + 2,).

    Notes
    -----
    Units are drawn from the whole league, not fixture by fixture: with two pairs in each, the latter would make intervals too
    small by a third.

    What was played lies nearer to the parameters fitted to it than to the true ones, and so do the draws: they are stretched by
    sqrt(units / (units - strengths)), as standard errors are for degrees of freedom (MacKinnon and White, 1985), but by no more
    than sqrt(2). With two pairs for each of three fixtures, intervals of 95% cover about 84% without and 92% with it.

    The means of the priors are drawn anew too. Where there are games, that is hardly felt; where there are none, nothing else
    varies. The same holds for those of links.
    """
    strata = [stratum for stratum in strata if stratum]
    counts = sum((count(n_entries, stratum) for stratum in strata), np.zeros((n_entries, n_entries, 3)))
    shapes_unseen = unseen(counts, best).ravel()
    places = np.flatnonzero(shapes_unseen)
    games = [_spread(n_entries, sorted(stratum)) for stratum in strata]
    rng = np.random.default_rng(_SEED)
    draws = []
    for begin in range(0, n_draws, _CHUNK):
        n_chosen = min(_CHUNK, n_draws - begin)
        means = rng.normal(size=(n_chosen, n_entries + 2)) * deviations(n_entries)
        drawn = np.zeros((n_chosen, counts.size))
        drawn[:, places] = rng.standard_gamma(shapes_unseen[places], size=(n_chosen, len(places)))
        for stratum, (rows, used, begins) in zip(strata, games, strict=True):
            shapes = np.array([stratum[kind] for kind in sorted(stratum)], dtype=np.float64)
            weights = rng.standard_gamma(shapes, size=(n_chosen, len(shapes)))
            weights *= shapes.sum() / weights.sum(axis=1, keepdims=True)
            drawn[:, used] += np.add.reduceat(weights[:, rows], begins, axis=1)
        link_means = rng.normal(size=(n_chosen, len(links.pairs))) * links.deviation if links else None
        counted = drawn.reshape(n_chosen, n_entries, n_entries, 3)
        draws.append(fit(counted, start=best, means=means, links=links, link_means=link_means))
    n_units = sum(sum(stratum.values()) for stratum in strata)
    spared = max(n_units - (n_entries - 1), n_units / 2)
    stretched: Floats = best + (np.concatenate(draws) - best) * (n_units / spared if n_units else 1) ** 0.5
    return stretched


def _spread(n_entries: int, kinds: Iterable[Unit]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which kinds bring a game to which places of the counts, sorted by place: rows, the places, where each begins."""
    cells = [(np.ravel_multi_index(game, (n_entries, n_entries, 3)), row) for row, kind in enumerate(kinds) for game in kind]
    places, rows = np.array(sorted(cells)).T
    used, begins = np.unique(places, return_index=True)
    return rows, used, begins


def unseen(counts: Floats, best: Floats) -> Floats:
    """Return the Gamma shape of what each result weighs beyond what was seen, shape (entries, entries, 3)."""
    expected = counts.sum(axis=2) * chances(best).transpose(2, 0, 1)  # by result, blue, red
    strength = best[:-2]
    alone = np.eye(len(strength), dtype=bool)
    above = strength[None, :] > strength[:, None] - _SAME
    cuts = np.concatenate([alone, above])
    cuts = np.where(cuts[:, :1], cuts, ~cuts)  # either half may be called the upper one
    shapes = np.zeros_like(counts)
    for upper in np.unique(cuts, axis=0):
        for winners in (upper, ~upper):
            winner_is_blue = winners[:, None] & ~winners
            blue_wins, red_wins = expected[0] * winner_is_blue, expected[2] * winner_is_blue.T
            total = blue_wins.sum() + red_wins.sum()
            if total:
                shapes[..., 0] += UNSEEN * blue_wins / total
                shapes[..., 2] += UNSEEN * red_wins / total
    return shapes
