"""Demonstrations: what seats saw, what a teacher would have ordered there, and how the match ended."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.networks.features import UPSIDE_DOWN
from policies.training.sample_folder import SampleFolder

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
    side = samples.planes.shape[1]
    row, column = np.divmod(samples.cell, side)
    turned = samples._replace(
        planes=samples.planes[:, ::-1],
        cell=((side - 1 - row) * side + column).astype(np.int16),
        legal=samples.legal[..., UPSIDE_DOWN],
        labels=np.where(samples.labels == UNKNOWN, UNKNOWN, UPSIDE_DOWN[samples.labels]).astype(np.int8),
        chances=samples.chances[..., UPSIDE_DOWN],
        enemies=samples.enemies[:, ::-1],
    )
    both: list[tuple[NDArray[Any], NDArray[Any]]] = list(zip(samples, turned, strict=True))
    return Demonstrations(*(np.where(which.reshape(-1, *[1] * (one.ndim - 1)), other, one) for one, other in both))
