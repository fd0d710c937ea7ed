"""What the settings of all runs have in common that learn from samples in files."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Self

from arena.errors import InputError
from arena.game.ruleset import parse_overrides
from policies.training.settings import MOST_SEED, check_range, read_values


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleSettings:
    """The numbers of a run that learns from samples in files. Samples are ticks of one seat."""

    seed: int = 1
    """Of the weights, and of the order of the samples."""
    rules: str = "paper"
    data: list[str] = field(default_factory=list)
    """Folders of samples."""
    channels: int
    blocks: int
    passes: float
    """How often each sample is learned from."""
    minibatch: int
    """Samples of one step, over all processes."""
    rate: float
    """Learning rate at the start; it falls to a hundredth, along a cosine."""
    average: float
    """Decay of the running average of the weights that is saved, per step of the optimiser."""

    def check(self, method: str, what: str, command: str) -> None:
        """Refuse values with which nothing can be learned from samples.

        Parameters
        ----------
        method, what, command
            The method's name, the samples that it learns from, and what makes some.

        Raises
        ------
        InputError
            The sentence says which.
        """
        check_range(self, "seed", 0, MOST_SEED)
        for name in ("channels", "blocks", "minibatch"):
            check_range(self, name, 1, 10**9)
        check_range(self, "passes", 0, math.inf, above=True, below=True)
        for name in ("rate", "average"):
            check_range(self, name, 0, 1, above=True, below=True)
        if type(self.data) is not list or any(type(path) is not str for path in self.data):
            raise InputError(f"the setting data is {self.data!r}; it must be a list of folders, each of which --data gives")
        if not self.data:
            raise InputError(f"the method {method} learns from {what}; give a folder by --data, `{command}` makes one")

    def with_(self, assignments: Iterable[str]) -> Self:
        """Return a copy with values such as "passes=5" replaced."""
        return read_values(type(self), {**asdict(self), **parse_overrides(assignments)})
