"""Networks that only training has, never a seat: who wins, and where the enemy is."""

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from policies.networks.features import N_PLANES, N_SCALARS, ONE
from policies.networks.models import TeamShape, Trunk, summarise

N_TRUTH_PLANES = 5
"""Planes of the true state that only training sees; see `policies.training.truth`."""
N_ENEMY_PLANES = 2
"""The first of them: the enemy's units on foot, and in the air."""


class Judge(nn.Module):
    """Who wins, judged by what a team sees, from the trunk of its network: an auxiliary task of training, never in a seat."""

    def __init__(self, shape: TeamShape) -> None:
        super().__init__()
        self.mix = nn.Linear(2 * shape.channels + N_SCALARS, 64)
        self.out = nn.Linear(64, 1)

    def forward(self, board: Tensor, scalars: Tensor) -> Tensor:
        """Return the value of each seat, float32, shape (n,), of the features of `TeamNetwork.look`."""
        hidden = functional.relu(self.mix(torch.cat([summarise(board), scalars.to(board.dtype)], 1)))
        return cast(Tensor, self.out(hidden)).float().squeeze(1)


class Locator(nn.Module):
    """Where the enemy's units are, seen or not, told from the trunk: an auxiliary task of training, never in a seat."""

    def __init__(self, shape: TeamShape) -> None:
        super().__init__()
        self.out = nn.Conv2d(shape.channels, 4 * N_ENEMY_PLANES, 1)

    def forward(self, board: Tensor) -> Tensor:
        """Return a logit of each cell, float32, shape (n, cells, N_ENEMY_PLANES), of the features of `TeamNetwork.look`."""
        n, _, half, _ = board.shape
        cells = self.out(board).float().view(n, 2, 2, N_ENEMY_PLANES, half, half).permute(0, 4, 1, 5, 2, 3)
        return cast(Tensor, cells.reshape(n, 4 * half * half, N_ENEMY_PLANES))


class Critic(nn.Module):
    """Who wins, judged by both sides' truth: for training only, never in a seat."""

    def __init__(self, channels: int = 32, blocks: int = 2) -> None:
        super().__init__()
        self.trunk = Trunk(N_PLANES + N_TRUTH_PLANES, channels, blocks)
        self.mix = nn.Linear(2 * channels + N_SCALARS, 128)
        self.out = nn.Linear(128, 1)

    def forward(self, planes: Tensor, truth: Tensor, scalars: Tensor) -> Tensor:
        """Return the value of each seat.

        Parameters
        ----------
        planes
            As `TeamNetwork.forward`.
        truth
            uint8, shape (n, side, side, N_TRUTH_PLANES).

        Returns
        -------
        Tensor
            float32, shape (n,).
        """
        kind = self.trunk.stem.weight.dtype
        whole = scalars.to(kind)
        board = self.trunk(torch.cat([planes, truth], 3).to(kind) * (1 / ONE), whole)
        hidden = functional.relu(self.mix(torch.cat([summarise(board), whole], 1)))
        return cast(Tensor, self.out(hidden)).float().squeeze(1)
