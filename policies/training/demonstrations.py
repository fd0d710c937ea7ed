"""Demonstrations: what seats saw, what a teacher would have ordered there, and how the match ended."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.networks.features import UPSIDE_DOWN, actions_upside_down, cells_upside_down
from policies.training.sample_folder import SampleFolder, choose

UNKNOWN = -1
"""The label of a unit that is not alive."""
CERTAIN = 255
"""Stands for a chance of 1."""


class Demonstrations(NamedTuple):
    """Samples: ticks of one seat, in the frame of `features.Encoder`."""

    planes: NDArray[np.uint8]
    """Shape (n, side, side, N_PLANES)."""
    scalars: NDArray[np.float32]
    """Shape (n, N_SCALARS)."""
    cell: NDArray[np.int16]
    """Shape (n, units)."""
    legal: NDArray[np.uint8]
    """Shape (n, units, actions)."""
    labels: NDArray[np.int8]
    """Shape (n, units): what the teacher ordered, or `UNKNOWN`."""
    chances: NDArray[np.uint8]
    """Shape (n, units, actions): the chances that it gave each action, in parts of `CERTAIN`."""
    enemies: NDArray[np.uint8]
    """Shape (n, side, side, N_ENEMY_PLANES): how many of the enemy's units truly stood there, whether seen or not."""
    outcome: NDArray[np.float32]
    """Shape (n,): 1 where the seat's match was won, -1 where it was lost."""


class DemonstrationFolder(SampleFolder[Demonstrations]):
    """The folder of demonstrations under one ruleset."""

    what, command, format, columns = "demonstrations", "arena train demonstrate", 2, Demonstrations


def mirrored(samples: Demonstrations, which: NDArray[np.bool_]) -> Demonstrations:
    """Return a copy in which some samples are mirrored north to south, where everything is worth the same; shape (n,)."""
    turned = samples._replace(
        planes=samples.planes[:, ::-1],
        cell=cells_upside_down(samples.cell, samples.planes.shape[1]),
        legal=samples.legal[..., UPSIDE_DOWN],
        labels=actions_upside_down(samples.labels),
        chances=samples.chances[..., UPSIDE_DOWN],
        enemies=samples.enemies[:, ::-1],
    )
    return choose(which, turned, samples)
