"""Intervals in which a true score lies with 95% certainty."""

import numpy as np
from numpy.typing import ArrayLike

Z95 = 1.959964
"""Quantile of the normal distribution for a two-sided interval of 95%."""


def margin_of(points: ArrayLike) -> float | None:
    """Return half the width of the interval of a mean, from the points per match of each pair; None without two pairs."""
    pairs = np.asarray(points)
    return Z95 * float(pairs.std(ddof=1)) / len(pairs) ** 0.5 if len(pairs) > 1 else None
