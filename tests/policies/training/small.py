"""Cloning and PPO in small, which tests of training share."""

from dataclasses import replace

import torch

from arena.envs.batched import BatchedEnv
from arena.game.ruleset import load as load_rules
from policies.networks.judges import Critic
from policies.networks.models import TeamNetwork, TeamShape
from policies.training.opponents import Opponents
from policies.training.parallel import Processes
from policies.training.ppo import Learner, Schedule
from policies.training.ppo_settings import PpoSettings
from policies.training.rollout import Experience, LearnerSeats

torch.set_num_threads(1)  # as `arena train` has it: threads that wait for each other cost more than they bring
PAPER = load_rules("paper")
SMALL = TeamShape(channels=8, blocks=1, patch=5, local=8, hidden=16)
SETTINGS = PpoSettings(
    games=8, horizon=6, minibatch=24, channels=8, blocks=1, critic_warmup=1, clone_samples=60, clone_minibatch=24,
    opponents={"self": 0.5, "best": 0.2, "past": 0.1, "rush": 0.2},
)  # fmt: skip
FULL = Schedule(rate=1e-3, entropy=0.0, shaping=0.0, is_critic_only=False, teacher_kl=0.0)


def make_seats(settings: PpoSettings = SETTINGS, seed: int = 1, first_row: int = 0, n_rows: int | None = None) -> LearnerSeats:
    torch.manual_seed(0)
    n_rows = settings.games if n_rows is None else n_rows
    opponents = Opponents(PAPER, settings.opponents, first_row, n_rows, TeamNetwork(SMALL))
    return LearnerSeats(BatchedEnv(PAPER, n_rows, seed=seed, first_row=first_row), opponents)


def make_learner(settings: PpoSettings = SETTINGS) -> Learner:
    torch.manual_seed(0)
    return Learner(TeamNetwork(SMALL), Critic(channels=8, blocks=1), settings, Processes())


def advantageous(experience: Experience, action: int) -> Experience:
    """Return a rollout in which every unit's `action` pays at once, and the match is over."""
    reward = (experience.actions == action).float().mean(-1)
    return replace(experience, reward=reward, has_ended=torch.ones_like(experience.has_ended))
