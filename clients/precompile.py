"""Compiling what a policy needs, before anybody waits for it."""

import numpy as np

from arena.game.ruleset import load
from arena.game.types import Team
from arena.policy import BatchFactory, BatchPolicy
from arena.protocol.observation_codec import ObservationReader


def precompile(make: BatchFactory) -> None:
    """Compile what a batch policy of ours needs by letting it act once; a stranger's bot is left alone."""
    if not (isinstance(make, type) and issubclass(make, BatchPolicy)):
        return
    ruleset = load("paper")
    blank = ObservationReader(ruleset, Team.BLUE).blank()
    policy = make(ruleset, Team.BLUE, 1)
    policy.start(np.zeros(1, np.intp))
    policy.act(blank, np.zeros(blank.cell.shape, np.int8))
