"""What the settings of all runs have in common that learn from samples in files."""

import math
from typing import Any, Protocol

from arena.errors import InputError
from policies.training.settings import MOST_SEED, check_range


class SampleSettings(Protocol):
    """The settings of a run that learns from samples in files."""

    @property
    def seed(self) -> int:
        """Of the weights, and of the order of the samples."""

    @property
    def rules(self) -> str:
        """The ruleset's name."""

    @property
    def data(self) -> list[str]:
        """Folders of samples."""

    @property
    def passes(self) -> float:
        """How often each sample is learned from."""

    @property
    def minibatch(self) -> int:
        """Samples of one step, over all processes."""

    @property
    def rate(self) -> float:
        """Learning rate at the start; it falls to a hundredth, along a cosine."""

    @property
    def average(self) -> float:
        """Decay of the running average of the weights that is saved, per step of the optimiser."""


def check_samples(settings: Any, method: str, what: str, command: str) -> None:
    """Refuse values with which nothing can be learned from samples.

    Parameters
    ----------
    settings
        `SampleSettings`, with the `channels` and `blocks` of a network.
    method, what, command
        The method's name, the samples that it learns from, and what makes some.

    Raises
    ------
    InputError
        The sentence says which.
    """
    check_range(settings, "seed", 0, MOST_SEED)
    for name in ("channels", "blocks", "minibatch"):
        check_range(settings, name, 1, 10**9)
    check_range(settings, "passes", 0, math.inf, above=True, below=True)
    for name in ("rate", "average"):
        check_range(settings, name, 0, 1, above=True, below=True)
    if type(settings.data) is not list or any(type(path) is not str for path in settings.data):
        raise InputError(f"the setting data is {settings.data!r}; it must be a list of folders, each of which --data gives")
    if not settings.data:
        raise InputError(f"the method {method} learns from {what}; give a folder by --data, `{command}` makes one")
