"""The settings of a run of cloning and PPO: one frozen dataclass, written into the run's folder and never changed."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from arena.errors import InputError
from arena.game.ruleset import parse_overrides
from policies.training.settings import MOST_SEED, check_range, check_shares, merge_shares, read_values

_COUNTS = (
    ("channels", 1, 1024), ("blocks", 1, 1024), ("critic_channels", 1, 4096), ("critic_blocks", 0, 4096), ("games", 1, 10**6),
    ("actors", 0, 1024), ("horizon", 2, 10**6), ("minibatch", 1, 10**9), ("epochs", 1, 10**6), ("critic_warmup", 0, 10**9),
    ("clone_samples", 1, 10**12), ("clone_minibatch", 1, 10**9), ("gate_matches", 1, 10**6),
)  # fmt: skip
"""The least and the most of each setting that is counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PpoSettings:
    """Every number of a run of cloning and PPO. Samples are ticks of one seat."""

    seed: int = 1
    rules: str = "paper"
    also: dict[str, float] = field(default_factory=dict)
    """Share of the lessons and rollouts that are of each of some other rulesets; the rest are of `rules`."""
    channels: int = 48
    blocks: int = 3
    critic_channels: int = 32
    """Of the critic's trunk, which costs as much for a sample as the network's own if it is as large."""
    critic_blocks: int = 2
    games: int = 192
    """Rows played at once, over all processes."""
    actors: int = 0
    """Threads of a process that play, each a part of the rows; 0 is one where the network computes on the CPU, and one for each
    processor where it computes on a GPU."""
    overlap: bool = False
    """Whether a thread plays the next rollout while this one is learned from, by the policy as it was before: for a GPU. On the
    CPU alone, processes under torchrun keep all cores busy without it."""
    horizon: int = 32
    """Ticks of a rollout."""
    minibatch: int = 1024
    """Samples of one step of PPO, over all processes."""
    epochs: int = 2
    rate: float = 6e-4
    """Learning rate at the start; it falls to a twentieth, along a cosine."""
    gamma: float = 0.995
    lambda_: float = 0.92
    clip: float = 0.2
    entropy: float = 0.01
    """Weight of the entropy at the start."""
    entropy_left: float = 0.1
    """Share of that weight at which it stays: it falls along a line that reaches nothing at the end of the run. 1 keeps it."""
    shaping: float = 1.0
    """Weight of differences of the score (in hundredths) at the start; it falls to nothing by two thirds of the run."""
    target_kl: float = 0.03
    """An update that has moved the policy so far stops."""
    average: float = 0.99
    """Decay of the running average of the weights that is played and saved, per step of the optimiser."""
    teacher_kl: float = 0.0
    """Weight, at the start of PPO, of the divergence from the network that PPO started from; 0 lets it go where it wants."""
    teacher_share: float = 0.5
    """Share of PPO's part of the run in which that weight falls to nothing, along a line."""
    critic_warmup: int = 4
    """Rollouts in which only the critic learns."""
    clone_samples: int = 400_000
    """Samples of cloning, where the run starts from a script."""
    teachers: dict[str, str] = field(default_factory=dict)
    """Who is cloned under each ruleset, where it is not the fighter of `--start clone:`; a run that starts from a checkpoint
    begins by cloning, too, if there are teachers."""
    clone_rate: float = 1.5e-3
    clone_minibatch: int = 256
    opponents: dict[str, float] = field(
        default_factory=lambda: {
            "self": 0.3,
            "best": 0.2,
            "past": 0.1,
            "role_team": 0.15,
            "rush": 0.1,
            "fighter": 0.05,
            "roomba": 0.1,
        }
    )
    """Share of the rows for each: `self` learns on both sides, `best` is the last self that passed the gate, `past` one of those
    before it, drawn by how often it wins; any other name is a fighter as `arena play` takes it."""
    priority: float = 0.0
    """Power of prioritised fictitious self-play among the scripts: those that beat the learner get more of the rows that scripts
    have together, see `opponents.prioritise`. 0 keeps the shares; 1 or 2 is usual."""
    gate_matches: int = 200
    gate_score: float = 0.55
    """Score that the learner needs over the last `gate_matches` against `best` to take its place."""

    def __post_init__(self) -> None:
        check_range(self, "seed", 0, MOST_SEED)
        for name, least, most in _COUNTS:
            check_range(self, name, least, most)
        for name in ("rate", "clone_rate", "gamma", "teacher_share"):
            check_range(self, name, 0, 1, above=True)
        for name in ("lambda_", "entropy_left", "gate_score"):
            check_range(self, name, 0, 1)
        for name in ("clip", "target_kl"):
            check_range(self, name, 0, above=True)
        for name in ("entropy", "shaping", "teacher_kl", "priority"):
            check_range(self, name, 0, math.inf, below=True)
        check_range(self, "average", 0, 1, below=True)
        check_shares("opponents", self.opponents)
        if strangers := set(self.teachers) - set(self.shares()):
            raise InputError(
                f"the setting teachers names {', '.join(sorted(strangers))}; the run's rulesets are {', '.join(self.shares())}"
            )
        if not (all(share >= 0 for share in self.also.values()) and sum(self.also.values()) < 1 and self.rules not in self.also):
            raise InputError(f"the setting also must give other rulesets than {self.rules} shares of less than 1 in all")

    def shares(self) -> dict[str, float]:
        """Return the share of each ruleset."""
        return {self.rules: 1 - sum(self.also.values()), **self.also}

    def with_(self, assignments: Iterable[str]) -> "PpoSettings":
        """Return a copy with values such as "games=64" or "opponents.rush=0.5" replaced."""
        return from_dict({**asdict(self), **_merged(self, parse_overrides(assignments))})


def from_dict(values: dict[str, Any]) -> PpoSettings:
    """Return settings from what a run's folder holds, or a user wrote; an unknown or ill-typed value is an `InputError`."""
    return read_values(PpoSettings, values)


def _merged(old: PpoSettings, new: dict[str, Any]) -> dict[str, Any]:
    """Return new values; shares of opponents and rulesets that are not named stay."""
    for name in ("opponents", "also"):
        if name in new:
            new[name] = merge_shares(name, getattr(old, name), new[name])
    if "teachers" in new:
        mine = new["teachers"]
        if not isinstance(mine, dict) or not all(isinstance(fighter, str) for fighter in mine.values()):
            raise InputError(
                f"the setting teachers is {mine!r}; it takes fighters by ruleset, as in 'teachers.NAME=\"role_team\"'"
            )
        new["teachers"] = {**old.teachers, **mine}
    return new
