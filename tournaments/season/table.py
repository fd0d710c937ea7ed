"""How a season rates its current versions: by all matches that say something of them, those of earlier versions too."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tournaments.ratings.davidson import Floats
from tournaments.ratings.normal import Posterior, fit_counts
from tournaments.ratings.rate import Follows, Rating, places_of, ratings_of
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
    fitted: Mapping[str, float]
    """The strengths of all that were rated, earlier versions too: where the next fit begins."""

    def part(self, labels: Sequence[str]) -> Posterior:
        """Return what is known of some of the labels."""
        index = {label: number for number, label in enumerate(self.labels)}
        return _part(self.posterior, [index[label] for label in labels])

    def widths(self, labels: Sequence[str]) -> Floats:
        """Return how wide the 95% intervals of some labels are, in Elo."""
        ratings = [self.ratings[label] for label in labels]
        return np.array([rating.elo_high - rating.elo_low for rating in ratings])


def rate_season(results: Results, labels: Sequence[str], follows: Follows, before: Table | None = None) -> Table:
    """Rate the current versions.

    Parameters
    ----------
    labels
        Of the current versions.
    follows
        Each version that has one after it, and that one.
    before
        An earlier table, from which the fit is nearer.
    """
    rated = results.find_rated(labels)
    start = None if before is None else _start(rated, before)
    whole = fit_counts(results.table(rated), follows=places_of(rated, follows), start=start)
    known = _part(whole, range(len(labels)))
    # A newcomer, of whom nothing is known, must not move the mean that is 0 Elo.
    weights = np.array([float(results.record(label).n_matches) for label in labels])
    if not weights.any():
        weights = np.ones(len(labels))
    return Table(
        labels=tuple(labels),
        posterior=known,
        ratings=ratings_of(labels, known, n_draws=_N_DRAWS, weights=weights).entries if labels else {},
        fitted=dict(zip(rated, whole.strengths.tolist(), strict=True)),
    )


def _start(rated: Sequence[str], before: Table) -> Posterior:
    """Return where a fit of these labels begins; nothing but its parameters is looked at."""
    strengths = np.array([before.fitted.get(label, 0.0) for label in rated])
    known = before.posterior
    return Posterior(strengths=strengths, side=known.side, draw=known.draw, covariance=known.covariance)


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
