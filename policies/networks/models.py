"""The networks: `PaperNetwork` of the paper's Table 5, and `TeamNetwork`, which thinks for all units of a team at once.

Both take any number of units. `TeamNetwork` takes any board whose side is even; `PaperNetwork` sees a window of fixed size, and
`PaperTeam` is one or several of them.
"""

from dataclasses import dataclass
from typing import TypeVar, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from arena.game.types import FLAGS, HALVES, UAVS, UGVS, Code
from policies.networks.features import FIRST_DISTANCE, N_PLANES, N_SCALARS, ONE

N_ACTIONS = 5
SIGNED_PLANES: tuple[tuple[Code, ...], ...] = ((Code.HIDDEN,), HALVES, UGVS, UAVS, FLAGS, (Code.OBSTACLE,))
"""The codes of each of six planes: the first shows as 1; the second, the enemy's, as -1."""
_INDEX_LETTERS = 8
NEVER = -1e4
"""Logit of what cannot be done; finite, so that a product with zero stays zero."""


Net = TypeVar("Net", bound=nn.Module)


def channels_last(network: Net) -> Net:
    """Return the network itself, its convolutions laid out with the channels last, as the processor takes them."""
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs do not know this call
    return network


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamShape:
    """The sizes of a `TeamNetwork`."""

    channels: int = 48
    blocks: int = 3
    patch: int = 9
    """Side of the square around a unit that its head sees at full resolution, in cells; odd."""
    local: int = 96
    hidden: int = 128


class _Block(nn.Module):
    """Two convolutions and a way round them; begins as the identity, which is why it needs no normalisation."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels, channels, 3, padding=1)
        self.second = nn.Conv2d(channels, channels, 3, padding=1)
        nn.init.zeros_(self.second.weight)
        nn.init.zeros_(cast(Tensor, self.second.bias))

    def forward(self, board: Tensor) -> Tensor:
        return functional.relu(board + self.second(functional.relu(self.first(board))))


class Trunk(nn.Module):
    """The board at half its resolution, and the match as a whole."""

    def __init__(self, n_planes: int, channels: int, blocks: int) -> None:
        super().__init__()
        self.stem = nn.Conv2d(4 * n_planes, channels, 3, padding=1)
        self.whole = nn.Linear(N_SCALARS, channels)
        self.blocks = nn.ModuleList(_Block(channels) for _ in range(blocks))

    def forward(self, planes: Tensor, scalars: Tensor) -> Tensor:
        """Return features of each block of 2 x 2 cells.

        Parameters
        ----------
        planes
            Shape (n, side, side, planes).
        scalars
            Shape (n, N_SCALARS).

        Returns
        -------
        Tensor
            Shape (n, channels, side / 2, side / 2), with channels last in memory.
        """
        n, side, _, n_planes = planes.shape
        folded = planes.view(n, side // 2, 2, side // 2, 2, n_planes).transpose(2, 3)
        folded = folded.reshape(n, side // 2, side // 2, 4 * n_planes).permute(0, 3, 1, 2)
        board = functional.relu(self.stem(folded) + self.whole(scalars)[:, :, None, None])
        for block in self.blocks:
            board = block(board)
        return board


def summarise(board: Tensor) -> Tensor:
    """Return the mean and the largest of each channel; shape (n, 2 channels)."""
    return torch.cat([board.mean((2, 3)), board.amax((2, 3))], 1)


def planes_around(values: Tensor, cell: Tensor, patch: int) -> Tensor:
    """Return the planes in the square around each unit, distances as differences in steps; shape (n, units, patch**2 * planes).

    Parameters
    ----------
    values
        Planes as `TeamNetwork.look` returns them.
    cell
        int64, shape (n, units).
    patch
        Side of the square, in cells; odd.
    """
    n, side, _, n_planes = values.shape
    reach = patch // 2
    wide = side + 2 * reach
    padded = functional.pad(values, (0, 0, reach, reach, reach, reach)).view(n, wide * wide, n_planes)
    offsets = (torch.arange(patch, device=cell.device)[:, None] * wide + torch.arange(patch, device=cell.device)).view(-1)
    corner = cell // side * wide + cell % side
    seats = torch.arange(n, device=cell.device)[:, None, None]
    near = padded[seats, corner[:, :, None] + offsets]
    distances = near[..., FIRST_DISTANCE:]
    centre = distances[:, :, patch * patch // 2, None]
    near[..., FIRST_DISTANCE:] = ((distances - centre) * 8).clamp(-4, 4)
    return near.flatten(2)


def features_around(board: Tensor, cell: Tensor) -> Tensor:
    """Return the trunk's features of each unit's cell, the whole board in summary, and the unit's index.

    Returns
    -------
    Tensor
        Shape (n, units, n_around(channels)).
    """
    n, channels, half, _ = board.shape
    n_units, side = cell.shape[1], 2 * half
    row, column = cell // side, cell % side
    flat = board.permute(0, 2, 3, 1).reshape(n, half * half, channels)
    here = flat.gather(1, (row // 2 * half + column // 2)[:, :, None].expand(-1, -1, channels))
    corner = functional.one_hot(row % 2 * 2 + column % 2, 4).to(board.dtype)
    index = torch.arange(n_units, device=cell.device) % _INDEX_LETTERS
    letter = functional.one_hot(index, _INDEX_LETTERS).to(board.dtype).expand(n, -1, -1)
    return torch.cat([here, summarise(board)[:, None].expand(-1, n_units, -1), corner, letter], -1)


def n_around(channels: int) -> int:
    """Return how many numbers `features_around` tells of a unit."""
    return 3 * channels + 4 + _INDEX_LETTERS


class _Head(nn.Module):
    """From what surrounds a unit to its actions."""

    def __init__(self, shape: TeamShape) -> None:
        super().__init__()
        self.near = nn.Linear(shape.patch**2 * N_PLANES, shape.local)
        self.mix = nn.Linear(n_around(shape.channels) + shape.local, shape.hidden)
        self.out = nn.Linear(shape.hidden, N_ACTIONS)
        nn.init.normal_(self.out.weight, std=0.01)
        nn.init.zeros_(self.out.bias)

    def forward(self, near: Tensor, around: Tensor) -> Tensor:
        local = functional.relu(self.near(near))
        return cast(Tensor, self.out(functional.relu(self.mix(torch.cat([local, around], -1)))))


class TeamNetwork(nn.Module):
    """One pass over the board for all units; then a head for those that walk and one for those that fly.

    A head is given the features of the unit's cell, the planes around it at full resolution, the whole board in summary, and
    the unit's index, by which units that stand alike can choose otherwise.
    """

    def __init__(self, shape: TeamShape) -> None:
        super().__init__()
        self.shape = shape
        self.trunk = Trunk(N_PLANES, shape.channels, shape.blocks)
        self.walkers = _Head(shape)
        self.flyers = _Head(shape)

    def forward(self, planes: Tensor, scalars: Tensor, cell: Tensor, legal: Tensor, n_walkers: int) -> Tensor:
        """Return logits of each unit's actions; what is not legal has next to no chance.

        Parameters
        ----------
        planes
            uint8, shape (n, side, side, N_PLANES), as `features.Encoded`.
        scalars
            Shape (n, N_SCALARS).
        cell
            int64, shape (n, units).
        legal
            uint8, shape (n, units, actions).
        n_walkers
            Units that walk; they come first.

        Returns
        -------
        Tensor
            float32, shape (n, units, actions).
        """
        values, board = self.look(planes, scalars)
        return self.decide(values, board, cell, legal, n_walkers)

    def look(self, planes: Tensor, scalars: Tensor) -> tuple[Tensor, Tensor]:
        """Return the planes as the network computes with them, and the trunk's features, as `Trunk.forward`."""
        kind = self.trunk.stem.weight.dtype
        values = planes.to(kind) * (1 / ONE)
        return values, self.trunk(values, scalars.to(kind))

    def decide(self, values: Tensor, board: Tensor, cell: Tensor, legal: Tensor, n_walkers: int) -> Tensor:
        """Return logits as `forward`, of what `look` returned."""
        near, around = planes_around(values, cell, self.shape.patch), features_around(board, cell)
        parts = []
        if n_walkers:
            parts.append(self.walkers(near[:, :n_walkers], around[:, :n_walkers]))
        if n_walkers < cell.shape[1]:
            parts.append(self.flyers(near[:, n_walkers:], around[:, n_walkers:]))
        return torch.cat(parts, 1).float().masked_fill(legal == 0, NEVER)


class PaperNetwork(nn.Module):
    """The paper's Table 5, for one unit's own view: two convolutions without padding, a dense layer, five actions.

    Parameters
    ----------
    planes
        1, which is the paper's raw codes; one for each `Code`, 1 where it stands; or those of `SIGNED_PLANES`.
    """

    signs: Tensor

    def __init__(self, window: int = 20, planes: int = 1) -> None:
        super().__init__()
        self.window, self.planes = window, planes
        self.register_buffer("signs", _signs(), persistent=False)
        self.first = nn.Conv2d(planes, 32, 5)
        self.second = nn.Conv2d(32, 32, 3)
        self.dense = nn.Linear(32 * (window - 6) ** 2, 400)
        self.out = nn.Linear(400, N_ACTIONS)

    def forward(self, views: Tensor) -> Tensor:
        """Return logits, float32, shape (n, actions), of views of raw codes, shape (n, window, window)."""
        board = views[:, None]
        if self.planes == len(SIGNED_PLANES):
            board = self.signs[(views + 1).long()].permute(0, 3, 1, 2)
        elif self.planes > 1:
            board = board == torch.arange(-1, self.planes - 1, device=views.device)[:, None, None]
        board = board.to(self.first.weight.dtype)
        board = functional.relu(self.second(functional.relu(self.first(board))))
        board = board.permute(0, 2, 3, 1)  # as it lies in memory: another order would be copied here, and again on the way back
        return cast(Tensor, self.out(functional.relu(self.dense(board.flatten(1))))).float()


def _signs() -> Tensor:
    """Return what each code, from HIDDEN on, is in each of `SIGNED_PLANES`; shape (codes, planes)."""
    signs = torch.zeros(len(Code), len(SIGNED_PLANES))
    for plane, codes in enumerate(SIGNED_PLANES):
        for code, sign in zip(codes, (1.0, -1.0), strict=False):
            signs[code - Code.HIDDEN, plane] = sign
    return signs


class PaperTeam(nn.Module):
    """The paper's policies of a team: one `PaperNetwork` for all units, or one for each by its index.

    Units that are more than there are policies go round, so that a team of any size can play.

    Parameters
    ----------
    agents
        Networks; 1 is a policy that all units share.
    edge
        The code that cells off the board show in the views: HIDDEN or OBSTACLE.
    """

    def __init__(self, window: int = 20, agents: int = 1, planes: int = 1, edge: int = Code.HIDDEN) -> None:
        super().__init__()
        self.window, self.agents, self.planes, self.edge = window, agents, planes, int(edge)
        self.members = nn.ModuleList(PaperNetwork(window, planes) for _ in range(agents))

    def forward(self, views: Tensor, unit: Tensor) -> Tensor:
        """Return logits, float32, shape (n, actions).

        Parameters
        ----------
        views
            Shape (n, window, window), as `PaperNetwork.forward`.
        unit
            int64, shape (n,): index of the unit that each view is of.
        """
        if self.agents == 1:
            return cast(Tensor, self.members[0](views))
        logits = views.new_zeros((len(views), N_ACTIONS), dtype=torch.float32)
        for index, member in enumerate(self.members):
            rows = (unit % self.agents == index).nonzero().squeeze(1)
            logits = logits.index_put((rows,), member(views[rows]))
        return logits
