"""Links between versions of an entry: how near a version is to the one before it, if the data say so.

A new version may be a touch, or another bot altogether. Of each two consecutive versions, two claims are weighed by what the
matches say of their difference, `d` with a standard error `e`: that they lie as two entries of the league do, `N(0, 2 spread^2)`;
or near each other, `N(0, deviation^2)`, with one of a few deviations for the whole league. That is a Bayes factor for each link,

    B(deviation) = N(d; 0, e^2 + deviation^2) / N(d; 0, e^2 + 2 spread^2),

and with either claim as likely beforehand, the evidence for a deviation is the product of `(1 + B) / 2` over all links (Laplace's
approximation: `d` and `e` are those of the normal posterior). Below `CLEAR` of it on average nothing is linked. Else the variance
is the mean of the squared deviations under their evidence, not the likeliest alone, which would make intervals too small where
links are few; and those links hold for which `B` is at least 1: a version that is another bot is not pulled back to what it was.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from tournaments.ratings.davidson import ELO, PRIOR_STRENGTH, Floats, Links

DEVIATIONS = np.array([10, 20, 40, 80, 160]) / ELO
"""Of linked versions, in units of strength."""
CLEAR = 3.0
"""Evidence from which versions are linked, as a Bayes factor: "positive" (Kass and Raftery, 1995)."""
_LEAST_SPREAD = 100 / ELO


def choose_links(strengths: Floats, difference_deviations: Floats, follows: Sequence[tuple[int, int]]) -> Links | None:
    """Return the links that the data favour; None if they favour none.

    Parameters
    ----------
    strengths
        Fitted without links, shape (entries,).
    difference_deviations
        Standard errors of all their differences, shape (entries, entries).
    follows
        Each version that has one after it, and that one.
    """
    if not follows:
        return None
    before, after = np.array(follows).T
    d, e = strengths[after] - strengths[before], difference_deviations[before, after]
    spread = np.clip(strengths.std(), _LEAST_SPREAD, PRIOR_STRENGTH)
    apart = norm.logpdf(d, scale=np.hypot(e, 2**0.5 * spread))
    factors = np.exp(norm.logpdf(d, scale=np.hypot(e, DEVIATIONS[:, None])) - apart)  # (deviations, links)
    log_evidence = np.log((1 + factors) / 2).sum(axis=1)
    evidence = np.exp(log_evidence - log_evidence.max())
    if log_evidence.max() + np.log(evidence.mean()) < np.log(CLEAR):
        return None
    deviation = float(np.sqrt((evidence * DEVIATIONS**2).sum() / evidence.sum()))
    holds = norm.logpdf(d, scale=np.hypot(e, deviation)) >= apart
    return Links(pairs=[pair for pair, does in zip(follows, holds, strict=True) if does], deviation=deviation)
