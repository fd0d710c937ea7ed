"""Rate entries: strengths as Elo, with intervals, ranges of ranks, and how likely each is to be the better of two.

`tournaments.ratings.davidson` is the model, `tournaments.ratings.bootstrap` what the intervals are made of.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr
from scipy.stats import rankdata

from arena.intervals import Z95
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.bootstrap import Game, Unit, bootstrap, count, game_of
from tournaments.ratings.davidson import ELO, Floats, fit
from tournaments.ratings.normal import Posterior, fit_counts

Follows = Sequence[tuple[str, str]]
"""Names of consecutive versions, the earlier first."""
N_DRAWS = 2_000
LEVEL = 0.95
_SEED = 20_031


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
    """All entries, and what the sides and draws are worth, as far as a method knows it."""

    entries: Mapping[str, Rating]
    superiority: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """How likely the first is to be the stronger: its share of the bootstrap's draws, one with equal strengths counting half."""
    side_elo: float = 0.0
    """What playing blue adds."""
    side_elo_low: float = 0.0
    side_elo_high: float = 0.0
    draw_rate: float | None = None
    """Share of draws between equals; None from a method without a model of draws, which expects no score of any fixture."""

    @property
    def is_side_favoured(self) -> bool:
        """Whether the interval of `side_elo` excludes 0."""
        return self.side_elo_low > 0 or self.side_elo_high < 0


def rate(
    names: Sequence[str],
    outcomes: Sequence[Outcome],
    *,
    are_maps_fresh: bool = False,
    n_draws: int = N_DRAWS,
    follows: Follows = (),
) -> Ratings:
    """Rate the entries of a league.

    Parameters
    ----------
    names
        Every entry, with matches or without.
    are_maps_fresh
        Whether no map came twice. Then the two matches of a pair have nothing in common, and the bootstrap draws matches; as many
        as were played with each side of the fixture as blue, since that was planned and not luck.
    n_draws
        Bootstrap draws behind the intervals; the same every time.
    follows
        Each version of an entry that has one after it, and that one. They share what they have in common if the data say so.
    """
    names = sorted(names)
    strata = units_of(names, outcomes, are_maps_fresh=are_maps_fresh)
    counts, links = count(len(names), units := sum(strata, Counter())), None
    if follows:
        links = fit_counts(counts, None if are_maps_fresh else units, follows=places_of(names, follows)).links
    best = fit(counts[None], links=links)[0]
    return _summarise(names, best, bootstrap(len(names), strata, best, n_draws, links))


def places_of(names: Sequence[str], follows: Follows) -> list[tuple[int, int]]:
    """Return the places of versions in `names`; those with a neighbour that is not there are left out."""
    index = {name: number for number, name in enumerate(names)}
    return [(index[before], index[after]) for before, after in follows if before in index and after in index]


def units_of(names: Sequence[str], outcomes: Iterable[Outcome], *, are_maps_fresh: bool) -> list[Counter[Unit]]:
    """Return how often each kind of unit was seen: of pairs, or by side of matches where maps are fresh."""
    index = {name: number for number, name in enumerate(names)}
    games: list[tuple[str, Game]] = []
    for outcome in outcomes:
        games.append((outcome.identity, game_of(outcome, index)))
    if are_maps_fresh:
        return [Counter((game,) for _, game in games if (game[0] < game[1]) is is_first_blue) for is_first_blue in (True, False)]
    pairs: defaultdict[str, list[Game]] = defaultdict(list)
    for identity, game in games:
        pairs[LeagueMatchId.parse(identity).pair_id].append(game)
    return [Counter(tuple(sorted(pair)) for pair in pairs.values())]


def _summarise(names: Sequence[str], best: Floats, draws: Floats) -> Ratings:
    n_entries = len(names)
    tails = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
    elo = _elo(best[None], n_entries)[0]
    many = _elo(draws, n_entries)
    low, high = np.quantile(many, tails, axis=0)
    rank = rankdata(-elo.round(6), method="min").astype(int)
    rank_low, rank_high = np.quantile(rankdata(-many, axis=1), tails, axis=0, method="nearest").round().astype(int)
    above = _superiority(many)
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
        superiority={(one, other): float(above[i, j]) for i, one in enumerate(names) for j, other in enumerate(names) if i != j},
        side_elo=float(best[n_entries] * ELO),
        side_elo_low=float(side_low),
        side_elo_high=float(side_high),
        draw_rate=nu / (nu + 2),
    )


def _elo(parameters: Floats, n_entries: int) -> Floats:
    strengths = parameters[:, :n_entries]
    elo: Floats = ELO * (strengths - strengths.mean(axis=1, keepdims=True))
    return elo


def _superiority(elo: Floats) -> Floats:
    """Return the share of draws in which the row's entry is above the column's, shape (entries, entries)."""
    ahead = np.sign((elo[:, :, None] - elo[:, None, :]).round(6))
    share: Floats = (1 + ahead.mean(axis=0)) / 2
    return share


def rate_normal(
    names: Sequence[str],
    outcomes: Sequence[Outcome],
    *,
    are_maps_fresh: bool = False,
    n_draws: int = N_DRAWS,
    follows: Follows = (),
) -> Ratings:
    """Rate the entries of a league as `rate` does, with intervals from a single fit; see `tournaments.ratings.normal`.

    `n_draws` are of the normal distribution, for the ranges of ranks alone.
    """
    names = sorted(names)
    units: Counter[Unit] = sum(units_of(names, outcomes, are_maps_fresh=are_maps_fresh), Counter())
    known = fit_counts(count(len(names), units), None if are_maps_fresh else units, follows=places_of(names, follows))
    return ratings_of(names, known, n_draws=n_draws)


def ratings_of(names: Sequence[str], known: Posterior, *, n_draws: int = N_DRAWS, weights: Floats | None = None) -> Ratings:
    """Return the ratings of a posterior; `names` are those of its strengths.

    `weights` are of the mean that is 0 Elo; all are alike without them.
    """
    n = len(names)
    elo, covariance = known.centred if weights is None else known.centre(weights)
    margin = Z95 * np.sqrt(np.diag(covariance))
    rank = rankdata(-elo.round(6), method="min").astype(int)
    low, high = _rank_ranges(elo, covariance, n_draws)
    deviations = ELO * known.difference_deviations
    np.fill_diagonal(deviations, 1)
    above = ndtr((elo[:, None] - elo[None, :]) / deviations)
    side, side_margin = ELO * known.side, Z95 * ELO * known.covariance[n, n] ** 0.5
    nu = float(np.exp(known.draw))
    return Ratings(
        entries={
            name: Rating(
                elo=float(elo[i]),
                elo_low=float(elo[i] - margin[i]),
                elo_high=float(elo[i] + margin[i]),
                rank=int(rank[i]),
                rank_low=int(min(low[i], rank[i])),
                rank_high=int(max(high[i], rank[i])),
            )
            for i, name in enumerate(names)
        },
        superiority={(one, other): float(above[i, j]) for i, one in enumerate(names) for j, other in enumerate(names) if i != j},
        side_elo=side,
        side_elo_low=side - side_margin,
        side_elo_high=side + side_margin,
        draw_rate=nu / (nu + 2),
    )


def _rank_ranges(elo: Floats, covariance: Floats, n_draws: int) -> tuple[Floats, Floats]:
    """Return the ends of the ranks that each entry has in `LEVEL` of the draws; the same every time."""
    values, vectors = np.linalg.eigh(covariance)
    normals = np.random.default_rng(_SEED).normal(size=(n_draws, len(elo)))
    drawn = elo + normals @ (vectors * np.sqrt(np.maximum(values, 0))).T
    ranks = np.argsort(np.argsort(-drawn, axis=1), axis=1) + 1
    low, high = np.quantile(ranks, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0, method="nearest").astype(int)
    return low, high
