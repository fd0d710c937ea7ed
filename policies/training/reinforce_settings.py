"""The settings of a run of the paper's method: Table 3, and a switch wherever the paper can be read in more than one way."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from arena.errors import InputError
from arena.game.ruleset import parse_overrides
from arena.game.types import Code
from policies.networks.checkpoint import MOST_AGENTS, MOST_WINDOW
from policies.networks.first_person import WINDOW
from policies.networks.models import SIGNED_PLANES
from policies.training.opponents import SELF
from policies.training.settings import MOST_SEED, check_range, read_values

READINGS = {
    "policies": ("shared", "each"),
    "reward": ("terminal", "stream", "differences"),
    "standardise": ("none", "trajectory"),
    "baseline": ("none", "mean"),
    "optimiser": ("adam", "ascent"),
    "codes": ("raw", "planes", "signed"),
    "edge": ("hidden", "obstacle"),
}
"""The switches that are words, and the words that each takes; the first is the default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReinforceSettings:
    """Every number and every reading; `policies.training.reinforce` says where each stands in the paper."""

    seed: int = 1
    rules: str = "exp1"
    gamma: float = 0.98
    rate: float = 1e-4
    update_every: int = 10
    """Matches between two updates, over all processes; the policy stands still in them."""
    buffer: int = 50_000
    """Samples of replay, over all processes: one is a tick of one unit."""
    batch: int = 2_000
    updates: int = 1
    """Batches drawn, and steps taken, per update."""
    warmup: int = 0
    """Matches at the start in which all units act at random; they fill the replay, and no update comes before their end."""
    policies: str = "shared"
    reward: str = "terminal"
    stall: float = 0.0
    """Points that the last tick of a match pays besides, if it ran out of ticks."""
    standardise: str = "none"
    """Whether the returns of each unit in each match are given mean 0 and standard deviation 1."""
    discount_steps: bool = True
    """Whether a step counts gamma^t times, as Algorithm 1 has it and most implementations have not."""
    importance: float = 0.0
    """The most that an importance weight may be; 0 leaves the weights out."""
    baseline: str = "none"
    normalise: bool = False
    """Whether returns are divided by their standard deviation in the batch."""
    optimiser: str = "adam"
    codes: str = "raw"
    """How the board is shown: as one plane of raw codes, which is the paper's way, as a plane for each code, or as six planes in
    which own is 1 and the enemy's is -1."""
    edge: str = "hidden"
    """What cells off the board look like."""
    entropy: float = 0.0
    """Weight of the policy's entropy; the paper has none."""
    opponent: str = SELF
    """`self`, which is the policy as it stood at the last update, or a fighter as `arena play` takes it."""
    window: int = WINDOW
    """Side of a unit's view, in cells."""
    bf16: bool = True
    """Whether the network computes in bf16, where that is faster."""

    def __post_init__(self) -> None:
        for name, words in READINGS.items():
            if getattr(self, name) not in words:
                raise InputError(f"the setting {name} is {getattr(self, name)!r}; it must be one of {', '.join(words)}")
        check_range(self, "seed", 0, MOST_SEED)
        for name, least in {"update_every": 1, "buffer": 1, "batch": 2, "updates": 1, "warmup": 0}.items():
            check_range(self, name, least, 10**9)
        check_range(self, "window", 7, MOST_WINDOW)
        for name in ("gamma", "rate"):
            check_range(self, name, 0, 1, above=True)
        check_range(self, "stall", -100, 100)  # as scores are
        for name in ("importance", "entropy"):
            check_range(self, name, 0, math.inf, below=True)

    def with_(self, assignments: Iterable[str]) -> "ReinforceSettings":
        """Return a copy with values such as "reward=stream" replaced."""
        return from_dict({**asdict(self), **parse_overrides(map(_quoted, assignments))})

    @property
    def planes(self) -> int:
        """Planes of a unit's view, as `networks.PaperNetwork` has them."""
        return {"raw": 1, "planes": len(Code), "signed": len(SIGNED_PLANES)}[self.codes]

    @property
    def edge_code(self) -> Code:
        """What cells off the board show."""
        return Code[self.edge.upper()]

    def agents(self, n_units: int) -> int:
        """Return how many policies a team of `n_units` has."""
        if self.policies == "shared":
            return 1
        if n_units > MOST_AGENTS:
            raise InputError(f"policies=each takes teams of {MOST_AGENTS} units at most, not of {n_units}")
        return n_units


def _quoted(assignment: str) -> str:
    """Return an assignment whose value is a word as TOML has it, so that nobody needs quotes within quotes."""
    name, _, value = assignment.partition("=")
    is_word = value.strip().isidentifier() and value.strip() not in ("true", "false")
    return f'{name}="{value.strip()}"' if is_word else assignment


def from_dict(values: dict[str, Any]) -> ReinforceSettings:
    """Return settings from what a run's folder holds, or a user wrote; an unknown or ill-typed value is an `InputError`."""
    return read_values(ReinforceSettings, values)
