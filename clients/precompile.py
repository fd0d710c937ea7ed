"""Compiling what a fighter needs, before anybody waits for it."""

import numpy as np

from arena.game.ruleset import load
from arena.game.types import Team
from arena.policy import BatchFactory, BatchPolicy
from arena.protocol.observation_codec import ObservationReader


def warm(make: BatchFactory) -> None:
    """Compile what one of our own fighters needs, before anybody waits for it. A stranger's bot is left alone."""
    if not (isinstance(make, type) and issubclass(make, BatchPolicy)):
        return
    ruleset = load("paper")
    nothing = ObservationReader(ruleset, Team.BLUE).blank()
    policy = make(ruleset, Team.BLUE, 1)
    policy.start(np.zeros(1, np.intp))
    policy.act(nothing, np.zeros(nothing.cell.shape, np.int8))
