"""What an `Appraiser` makes of a tick, for those who know no tensors: one pass over the boards by torch, plans by a kernel.

The kernel takes a microsecond and a half for a plan. Torch, called for a few plans at a time, took some seventy for each.
"""

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from arena.jit import jit
from policies.networks.appraiser import Appraiser
from policies.networks.features import Encoded, actions_upside_down, upside_down


class Head(NamedTuple):
    """The weights by which an `Appraiser` values a plan, float32; the first axis of two is of units that walk, and that fly."""

    role: NDArray[np.float32]
    """Shape (2, roles, hidden)."""
    first: NDArray[np.float32]
    """Shape (2, 1 + actions, hidden)."""
    team: NDArray[np.float32]
    """Shape (hidden, values); the whole board has the bias."""
    mix: NDArray[np.float32]
    """Shape (values, values)."""
    mix_bias: NDArray[np.float32]
    """Shape (values,)."""
    out: NDArray[np.float32]
    """Shape (values,)."""
    out_bias: np.float32


class Work(NamedTuple):
    """Scratch for the values of a plan, float32."""

    acting: NDArray[np.float32]
    """Shape (hidden,)."""
    team: NDArray[np.float32]
    """Shape (values,)."""
    mixed: NDArray[np.float32]
    """Shape (values,)."""

    @classmethod
    def of(cls, head: Head) -> "Work":
        """Return memory for the plans of a head."""
        n_hidden, n_values = head.team.shape
        return cls(*(np.empty(n, np.float32) for n in (n_hidden, n_values, n_values)))


def read_head(network: Appraiser) -> Head:
    """Return a copy of a network's weights, inputs before outputs."""

    def inputs_first(layer: nn.Linear) -> NDArray[np.float32]:
        return np.ascontiguousarray(layer.weight.detach().numpy().T, np.float32)

    role, first, mix_bias = (one.detach().numpy().copy() for one in (network.role, network.first, network.mix.bias))
    out, out_bias = inputs_first(network.out)[:, 0].copy(), np.float32(network.out.bias.item())
    return Head(role, first, inputs_first(network.team), inputs_first(network.mix), mix_bias, out, out_bias)


class Appraisal:
    """What a network makes of the seats of a tick; made once, for all ticks.

    Parameters
    ----------
    n_walkers
        Units that walk; they come first.
    is_mirrored
        Whether logits are the mean of those on the board and on its north-south mirror image.
    """

    def __init__(self, network: Appraiser, n_walkers: int, *, is_mirrored: bool) -> None:
        self._network, self._n_walkers, self._is_mirrored = network, n_walkers, is_mirrored
        self._head = read_head(network)
        self._work = Work.of(self._head)

    def look(self, encoded: Encoded, likely: NDArray[np.float32]) -> None:
        """Look at a tick of some seats; `likely` is float32, shape (n, models), as in `Appraiser.look`."""
        self._alive, boards = encoded.alive, (encoded, upside_down(encoded)) if self._is_mirrored else (encoded,)
        self._views = [self._pass(board, likely) for board in boards]

    def logits(self, role: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the logit of each plan's share of a win, shape (n, plans); the plans are those of `Appraiser.appraise`."""
        total = np.zeros(role.shape[:2], np.float32)
        for view, (units, whole) in enumerate(self._views):
            turned = actions_upside_down(first) if view else first
            _add_logits(units, whole, self._alive, role, turned, self._n_walkers, self._head, self._work, total)
        return total / np.float32(len(self._views))

    def _pass(self, encoded: Encoded, likely: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return `Outlook.units`, and `Outlook.whole` with the bias of the team."""
        arrays = (encoded.planes, encoded.scalars, encoded.cell, encoded.alive, likely)
        planes, scalars, cell, alive, models = map(torch.from_numpy, arrays)
        with torch.inference_mode():
            outlook = self._network.look(planes, scalars, cell, alive, models, self._n_walkers)
            return outlook.units.numpy(), (outlook.whole + self._network.team.bias).numpy()


@jit()
def _add_logits(
    units: NDArray[np.float32],
    whole: NDArray[np.float32],
    alive: NDArray[np.uint8],
    role: NDArray[np.int64],
    first: NDArray[np.int64],
    n_walkers: int,
    head: Head,
    work: Work,
    total: NDArray[np.float32],
) -> None:
    """Add the logit of each plan to `total`, shape (n, plans): what `Appraiser.appraise` returns."""
    acting, team, mixed = work
    n_hidden, n_values = head.team.shape
    nothing = np.float32(0)
    for seat in range(total.shape[0]):
        for plan in range(total.shape[1]):
            for k in range(n_hidden):
                acting[k] = nothing
            for unit in range(units.shape[1]):
                if alive[seat, unit]:
                    kind, deed, step = int(unit >= n_walkers), role[seat, plan, unit], first[seat, plan, unit] + 1
                    for k in range(n_hidden):
                        acting[k] += max(units[seat, unit, k] + head.role[kind, deed, k] + head.first[kind, step, k], nothing)
            for j in range(n_values):
                team[j], mixed[j] = whole[seat, j], head.mix_bias[j]
            for k in range(n_hidden):
                for j in range(n_values):
                    team[j] += acting[k] * head.team[k, j]
            for k in range(n_values):
                value = max(team[k], nothing)
                for j in range(n_values):
                    mixed[j] += value * head.mix[k, j]
            logit = head.out_bias
            for j in range(n_values):
                logit += max(mixed[j], nothing) * head.out[j]
            total[seat, plan] += logit
