"""Whether a step may be taken: a gradient that is not finite, or out of all bounds, ends the run before it spoils the weights."""

import math
from collections.abc import Iterable

from torch import Tensor, nn

from arena.errors import ArenaError

EXPLODED = 1e6
"""A gradient of this norm is no longer one to learn from; what trains well stays below a few hundred."""


class TrainingError(ArenaError):
    """Training cannot go on; what was saved before is good."""


def bound_gradients(parameters: Iterable[Tensor], most_norm: float = math.inf) -> float:
    """Return the gradients' norm, and cut them to `most_norm`.

    Raises
    ------
    TrainingError
        The norm is not finite, or has exploded; no step must be taken with it.
    """
    norm = float(nn.utils.clip_grad_norm_(parameters, most_norm))
    if not norm < EXPLODED:  # NaN is not
        how = "has exploded" if math.isfinite(norm) else "is not finite any more"
        raise TrainingError(f"the gradient {how}; the last checkpoint is good: lower the rate, and start from it")
    return norm
