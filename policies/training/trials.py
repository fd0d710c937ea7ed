"""Trials: what seats saw, which plans were tried there, and what these came to in playouts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.networks.features import actions_upside_down, cells_upside_down
from policies.training.sample_folder import SampleFolder, choose


class Trials(NamedTuple):
    """Samples: ticks of one seat, in the frame of `features.Encoder`."""

    planes: NDArray[np.uint8]
    """Shape (n, side, side, N_PLANES)."""
    scalars: NDArray[np.float32]
    """Shape (n, N_SCALARS)."""
    cell: NDArray[np.int16]
    """Shape (n, units)."""
    alive: NDArray[np.uint8]
    """Shape (n, units)."""
    likely: NDArray[np.float32]
    """Shape (n, models): how likely the enemy is to play by each model."""
    role: NDArray[np.int8]
    """Shape (n, plans, units)."""
    first: NDArray[np.int8]
    """Shape (n, plans, units): the action of the frame with which a unit begins, or `plans.FROM_ROLE`."""
    value: NDArray[np.float32]
    """Shape (n, plans): the mean share of a win over the worlds that a plan was tried in, or `trials.UNTRIED`."""


class TrialFolder(SampleFolder[Trials]):
    """The folder of trials under one ruleset."""

    what, command, format, columns = "trials", "arena train try-plans", 1, Trials


def mirrored(samples: Trials, which: NDArray[np.bool_]) -> Trials:
    """Return a copy in which some samples are mirrored north to south, where every plan is worth the same; shape (n,)."""
    turned = samples._replace(
        planes=samples.planes[:, ::-1],
        cell=cells_upside_down(samples.cell, samples.planes.shape[1]),
        first=actions_upside_down(samples.first),
    )
    return choose(which, turned, samples)
