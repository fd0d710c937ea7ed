"""The experience replay of the paper: what units saw and did lately, from which batches are drawn uniformly."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor


class Samples(NamedTuple):
    """Ticks of single units; n of them."""

    views: Tensor
    """int8, shape (n, window, window), as `policies.networks.first_person` cuts them."""
    unit: Tensor
    """int64, shape (n,): index of the unit in its team."""
    action: Tensor
    """int64, shape (n,): of the unit's frame."""
    logp: Tensor
    """float32, shape (n,): log-probability of the action when it was drawn."""
    tick: Tensor
    """int64, shape (n,): ticks of the match that had passed."""
    returned: Tensor
    """float32, shape (n,): discounted sum of the team's rewards from here on."""
    update: Tensor
    """int64, shape (n,): updates that the policy had behind it."""


class Replay:
    """A ring of samples: the newest take the place of the oldest."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.n = 0
        """Samples that it holds."""
        self._next = 0
        self._kept: Samples | None = None

    def add(self, new: Samples) -> None:
        """Take in samples; of more than fit, the last."""
        new = Samples(*(one[-self.capacity :] for one in new))
        if self._kept is None:
            self._kept = Samples(*(one.new_zeros((self.capacity, *one.shape[1:])) for one in new))
        rows = (self._next + torch.arange(len(new.unit))) % self.capacity
        for kept, one in zip(self._kept, new, strict=True):
            kept[rows] = one
        self._next = (self._next + len(rows)) % self.capacity
        self.n = min(self.n + len(rows), self.capacity)

    def draw(self, n: int, rng: np.random.Generator) -> Samples:
        """Return `n` samples, each drawn from all alike, so that one may come twice.

        Raises
        ------
        ValueError
            There is nothing to draw from.
        """
        if self._kept is None or not self.n:
            raise ValueError("the replay is empty")
        rows = torch.from_numpy(rng.integers(0, self.n, n))
        return Samples(*(one[rows] for one in self._kept))
