"""Intervals in which a true score lies with 95% certainty."""

import numpy as np
from numpy.typing import ArrayLike

Z95 = 1.959964
"""Quantile of the normal distribution for a two-sided interval of 95%."""


def margin_of(points: ArrayLike, reach: float = 1.0) -> float | None:
    """Return half the width of the interval of a mean, from the points per match of each pair; None without two pairs.

    Pairs that are all alike show no spread, and not that there is none: with 95% certainty, others are rarer than
    1 - 0.05 ** (1 / pairs), the exact form of the rule of three, and none lies farther away than `reach`.
    """
    pairs = np.asarray(points)
    if len(pairs) < 2:
        return None
    spread = float(pairs.std(ddof=1))
    return Z95 * spread / len(pairs) ** 0.5 if spread else reach * (1 - float(0.05 ** (1 / len(pairs))))
