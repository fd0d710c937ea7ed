"""How a season rates its current versions: by all matches that say something of them, those of earlier versions too."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tournaments.ratings.normal import Posterior, fit_counts
from tournaments.ratings.rate import Rating, ratings_of
from tournaments.season.results import Results

_N_DRAWS = 500
"""Behind the ranges of ranks."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """What is known of the current versions of a season."""

    labels: tuple[str, ...]
    posterior: Posterior
    """Of `labels` alone, in their order."""
    ratings: Mapping[str, Rating]

    def part(self, labels: Sequence[str]) -> Posterior:
        """Return what is known of some of the labels."""
        index = {label: number for number, label in enumerate(self.labels)}
        return _part(self.posterior, [index[label] for label in labels])


def rate_season(results: Results, labels: Sequence[str], follows: Sequence[tuple[str, str]]) -> Table:
    """Rate the current versions.

    Parameters
    ----------
    labels
        Of the current versions.
    follows
        Each version that has one after it, and that one.
    """
    rated = results.find_rated(labels)
    index = {label: number for number, label in enumerate(rated)}
    places = [(index[before], index[after]) for before, after in follows if before in index and after in index]
    known = _part(fit_counts(results.table(rated), follows=places), range(len(labels)))
    ratings = ratings_of(labels, known, n_draws=_N_DRAWS).entries if labels else {}
    return Table(labels=tuple(labels), posterior=known, ratings=ratings)


def _part(known: Posterior, places: Sequence[int]) -> Posterior:
    """Return the marginal of some strengths, and of side and draw."""
    n = len(known.strengths)
    kept = np.array([*places, n, n + 1], dtype=np.intp)
    return Posterior(
        strengths=known.strengths[kept[:-2]],
        side=known.side,
        draw=known.draw,
        covariance=known.covariance[np.ix_(kept, kept)],
    )
