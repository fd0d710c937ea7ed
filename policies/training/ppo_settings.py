"""The settings of a run of cloning and PPO: one frozen dataclass, written into the run's folder and never changed."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from arena.errors import InputError
from arena.game.ruleset import parse_overrides
from policies.training.settings import merge_shares, read_values


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
        low = {
            "actors": 0,
            "games": 1,
            "horizon": 2,
            "minibatch": 1,
            "epochs": 1,
            "channels": 1,
            "critic_channels": 1,
            "critic_blocks": 0,
            "gate_matches": 1,
            "clone_samples": 1,
        }
        low["clone_minibatch"] = 1
        for name, least in low.items():
            if getattr(self, name) < least:
                raise InputError(f"the setting {name} is {getattr(self, name)}; it must be at least {least}")
        for name in ("teacher_kl", "priority"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"the setting {name} is {getattr(self, name)}; it must be a number from 0 on")
        if not 0 <= self.entropy_left <= 1:
            raise InputError(f"the setting entropy_left is {self.entropy_left}; it must be a number from 0 to 1")
        if not 0 < self.teacher_share <= 1:
            raise InputError(f"the setting teacher_share is {self.teacher_share}; it must be above 0 and at most 1")
        if not self.opponents or min(self.opponents.values()) < 0 or sum(self.opponents.values()) <= 0:
            raise InputError("the setting opponents must give each a share, and one of them more than 0")
        if strangers := set(self.teachers) - set(self.shares()):
            raise InputError(
                f"the setting teachers names {', '.join(sorted(strangers))}; the run's rulesets are {', '.join(self.shares())}"
            )
        if min(self.also.values(), default=0.0) < 0 or sum(self.also.values()) >= 1 or self.rules in self.also:
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
