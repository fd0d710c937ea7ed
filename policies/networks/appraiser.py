"""A network that says what a plan is worth: whatever role each unit takes, whatever its first step.

It looks at the board once. What it makes of that answers for any number of plans, in microseconds each, where a playout of one
takes thirty. It learns from playouts. Most of what one of them says is chance; what the network has learned is their mean.
"""

from dataclasses import dataclass
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from policies.networks.features import N_PLANES, N_SCALARS, ONE
from policies.networks.models import N_ACTIONS, TeamShape, Trunk, features_around, n_around, planes_around, summarise

_VALUES = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class AppraiserShape(TeamShape):
    """The sizes of an `Appraiser`."""

    channels: int = 24
    blocks: int = 2
    hidden: int = 96
    roles: int
    """Roles that a unit can take."""
    models: int
    """Models of the enemy."""


class Outlook(NamedTuple):
    """What an `Appraiser` makes of some boards, before it knows of a plan."""

    units: Tensor
    """Shape (n, units, hidden)."""
    whole: Tensor
    """Shape (n, values)."""
    alive: Tensor
    """Shape (n, units)."""


class Appraiser(nn.Module):
    """One pass over the board for all plans; then for each plan a sum over the units of what each does in it."""

    def __init__(self, shape: AppraiserShape) -> None:
        super().__init__()
        self.shape = shape
        self.trunk = Trunk(N_PLANES, shape.channels, shape.blocks)
        n_seen = n_around(shape.channels) + shape.local + shape.models
        self.near = nn.ModuleList(nn.Linear(shape.patch**2 * N_PLANES, shape.local) for _ in range(2))
        self.unit = nn.ModuleList(nn.Linear(n_seen, shape.hidden) for _ in range(2))
        self.role = nn.Parameter(0.1 * torch.randn(2, shape.roles, shape.hidden))
        self.first = nn.Parameter(0.1 * torch.randn(2, 1 + N_ACTIONS, shape.hidden))
        self.team = nn.Linear(shape.hidden, _VALUES)
        self.whole = nn.Linear(2 * shape.channels + N_SCALARS + shape.models, _VALUES)
        self.mix = nn.Linear(_VALUES, _VALUES)
        self.out = nn.Linear(_VALUES, 1)

    def look(self, planes: Tensor, scalars: Tensor, cell: Tensor, alive: Tensor, likely: Tensor, n_walkers: int) -> Outlook:
        """Return what is to be known of some boards.

        Parameters
        ----------
        planes, scalars, cell, alive
            As `features.Encoded`.
        likely
            float32, shape (n, models): how likely the enemy is to play by each model.
        n_walkers
            Units that walk; they come first.
        """
        values = planes.float() * (1 / ONE)
        board = self.trunk(values, scalars)
        near, around = planes_around(values, cell, self.shape.patch), features_around(board, cell)
        enemy = likely[:, None].expand(-1, cell.shape[1], -1)
        units = [
            unit(torch.cat([functional.relu(local(near[:, some])), around[:, some], enemy[:, some]], -1))
            for local, unit, some in zip(self.near, self.unit, _kinds(n_walkers), strict=True)
        ]
        return Outlook(torch.cat(units, 1), self.whole(torch.cat([summarise(board), scalars, likely], 1)), alive.float())

    def appraise(self, outlook: Outlook, role: Tensor, first: Tensor, n_walkers: int) -> Tensor:
        """Return the logit of each plan's share of a win, shape (n, plans).

        Parameters
        ----------
        role
            int64, shape (n, plans, units).
        first
            int64, shape (n, plans, units): the action of the frame with which a unit begins, or -1 where its role says it.
        """
        deeds = [
            roles[role[..., some]] + firsts[first[..., some] + 1]
            for roles, firsts, some in zip(self.role, self.first, _kinds(n_walkers), strict=True)
        ]
        acting = functional.relu(outlook.units[:, None] + torch.cat(deeds, 2)) * outlook.alive[:, None, :, None]
        team = functional.relu(self.team(acting.sum(2)) + outlook.whole[:, None])
        return cast(Tensor, self.out(functional.relu(self.mix(team)))).squeeze(-1)


def _kinds(n_walkers: int) -> tuple[slice, slice]:
    """Return the units that walk, and those that fly."""
    return slice(0, n_walkers), slice(n_walkers, None)
