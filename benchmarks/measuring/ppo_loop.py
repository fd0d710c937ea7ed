"""PPO's loop of playing and learning: samples a second, how near they come to the cores' roof, and what takes the time."""

import time
from dataclasses import replace
from statistics import median

import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from arena.envs.batched import BatchedEnv
from arena.game.ruleset import load as load_rules
from policies.networks.judges import Critic
from policies.networks.models import TeamNetwork, TeamShape, channels_last
from policies.training.opponents import Opponents
from policies.training.parallel import Processes
from policies.training.ppo import Learner, Schedule
from policies.training.ppo_settings import PpoSettings
from policies.training.rollout import Experience, LearnerSeats, Results, collect

FULL = Schedule(rate=1e-4, entropy=0.01, shaping=1.0, is_critic_only=False, teacher_kl=0.0)


class _Player(TeamNetwork):
    """A network that adds up the time that it takes to act."""

    def __init__(self, network: TeamNetwork) -> None:
        super().__init__(network.shape)
        self.load_state_dict(network.state_dict())
        self.to(network.trunk.stem.weight.dtype)
        channels_last(self.eval())
        self.seconds = 0.0

    def forward(self, planes: Tensor, scalars: Tensor, cell: Tensor, legal: Tensor, n_walkers: int) -> Tensor:
        begin_s = time.perf_counter()
        logits = super().forward(planes, scalars, cell, legal, n_walkers)
        self.seconds += time.perf_counter() - begin_s
        return logits


class _Learner(Learner):
    """A learner that adds up the time in which its critic judges a rollout."""

    judged_s = 0.0

    def values(self, experience: Experience) -> Tensor:
        begin_s = time.perf_counter()
        values = super().values(experience)
        self.judged_s += time.perf_counter() - begin_s
        return values


def measure_ppo(channels: int, blocks: int, roof_flops: float, *, games: int, horizon: int, runs: int) -> dict[str, float]:
    """Return what a core makes of PPO with a trunk of `channels` x `blocks`, with the settings that a run has by default.

    Parameters
    ----------
    roof_flops
        Floating-point operations a second of a large matrix product, in the numbers that the learner computes in.

    Returns
    -------
    dict
        `samples_per_s`; `of_roof`, the share of the roof that convolutions and products come to over the whole loop; and the
        shares of the time in which the network acts (`acting`), the game is played, encoded, and the opponents think (`game`),
        the critic judges (`judging`), and actor and critic learn (`learning`). Medians over `runs` rollouts.
    """
    ruleset = load_rules("paper")
    settings = replace(PpoSettings(), channels=channels, blocks=blocks, games=games, horizon=horizon, target_kl=float("inf"))
    torch.manual_seed(0)
    network = TeamNetwork(TeamShape(channels=channels, blocks=blocks))
    learner = _Learner(network, Critic(settings.critic_channels, settings.critic_blocks), settings, Processes())
    seats = LearnerSeats(BatchedEnv(ruleset, games, seed=1), Opponents(ruleset, settings.opponents, 0, games, network))
    generator = torch.Generator().manual_seed(0)

    def loop() -> tuple[float, ...]:
        player, learner.judged_s = _Player(learner.to_act()), 0.0
        begin_s = time.perf_counter()
        experience = collect(seats, player, horizon, Results())
        played_s = time.perf_counter() - begin_s
        learner.learn(experience, seats.n_walkers, FULL, generator)
        took_s = time.perf_counter() - begin_s
        n = experience.reward.numel()
        acting, judging = player.seconds / took_s, learner.judged_s / took_s
        return n / took_s, acting, played_s / took_s - acting, judging, 1 - played_s / took_s - judging

    with FlopCounterMode(display=False) as counted:  # the first loop, which compiles and warms up, too
        loop()
    flops = counted.get_total_flops() / (seats.n_seats * horizon)
    per_s, acting, game, judging, learning = (median(one) for one in zip(*(loop() for _ in range(runs)), strict=True))
    return {
        "samples_per_s": round(per_s), "of_roof": round(per_s * flops / roof_flops, 3), "acting": round(acting, 3),
        "game": round(game, 3), "judging": round(judging, 3), "learning": round(learning, 3),
    }  # fmt: skip
