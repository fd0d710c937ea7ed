"""Proximal policy optimisation of a `TeamNetwork`, with a critic that sees both sides.

All units of a team are drawn from one pass and share one advantage; each has its own ratio, since the product of six ratios would
leave the clip's range on chance alone. Source: Schulman et al., "Proximal policy optimization algorithms" (2017); Yu et al., "The
surprising effectiveness of PPO in cooperative multi-agent games" (2022). What keeps the policy near a teacher is the term of
Schmitt et al., "Kickstarting deep reinforcement learning" (2018): its divergence from the teacher's, with a weight that falls.
"""

import math
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from policies.networks.judges import Critic
from policies.networks.learned import chunk_on, infer_from
from policies.networks.models import TeamNetwork, channels_last
from policies.networks.precision import autocast, precision_of, to_act_in
from policies.training.gradients import bound_gradients
from policies.training.parallel import Processes
from policies.training.ppo_settings import PpoSettings
from policies.training.rollout import Experience

MOST_NORM = 0.5
"""The actor's gradients are cut to this norm, and so are the critic's: neither takes a part of the other's step."""


class ValueScale:
    """Running mean and spread of the returns: the critic learns what is left of them."""

    def __init__(self) -> None:
        self.mean, self.square, self.weight = 0.0, 0.0, 0.0

    def note(self, mean: float, square: float) -> None:
        """Take in the mean of some returns, and of their squares."""
        self.mean, self.square, self.weight = (
            0.95 * self.mean + 0.05 * mean,
            0.95 * self.square + 0.05 * square,
            0.95 * self.weight + 0.05,
        )

    @property
    def centre(self) -> float:
        """Mean of the returns."""
        return self.mean / self.weight if self.weight else 0.0

    @property
    def spread(self) -> float:
        """Standard deviation of the returns; at least a tenth."""
        return max((self.square / self.weight - self.centre**2), 0.01) ** 0.5 if self.weight else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """What changes in the course of a run."""

    rate: float
    entropy: float
    shaping: float
    is_critic_only: bool
    teacher_kl: float


def schedule(settings: PpoSettings, progress: float, rollouts: int) -> Schedule:
    """Return what holds at a point of the run; `progress` is that of PPO, from 0 to 1."""
    cosine = 0.5 + 0.5 * math.cos(math.pi * min(progress, 1.0))
    return Schedule(
        rate=settings.rate * (0.05 + 0.95 * cosine),
        entropy=settings.entropy * max(1 - progress, settings.entropy_left),
        shaping=settings.shaping * max(1 - 1.5 * progress, 0.0),
        is_critic_only=rollouts < settings.critic_warmup,
        teacher_kl=settings.teacher_kl * max(1 - progress / settings.teacher_share, 0.0),
    )


def estimate(experience: Experience, values: Tensor, schedule: Schedule, settings: PpoSettings) -> tuple[Tensor, Tensor]:
    """Return advantages and returns; generalised advantage estimation.

    Parameters
    ----------
    values
        float32, shape (t + 1, s), in the units of the reward.

    Returns
    -------
    tuple
        Two float32, shape (t, s).
    """
    reward = experience.reward + schedule.shaping * experience.gain
    goes_on = (~experience.has_ended).float()
    advantages = torch.zeros_like(reward)
    ahead = torch.zeros_like(reward[0])
    for tick in reversed(range(len(reward))):
        surprise = reward[tick] + settings.gamma * values[tick + 1] * goes_on[tick] - values[tick]
        ahead = surprise + settings.gamma * settings.lambda_ * goes_on[tick] * ahead
        advantages[tick] = ahead
    return advantages, advantages + values[:-1]


class Learner:
    """The network, its critic and its optimiser.

    Parameters
    ----------
    device
        Where they compute, as torch names it; rollouts come from the CPU, and what is told of them goes back there.
    """

    def __init__(
        self, network: TeamNetwork, critic: Critic, settings: PpoSettings, processes: Processes, device: str = "cpu"
    ) -> None:
        self.device = torch.device(device)
        self.network = channels_last(network.to(self.device))
        self.critic = channels_last(critic.to(self.device))
        self.settings, self.processes = settings, processes
        self.precision, self.chunk = precision_of(device), chunk_on(self.device)
        self.scale = ValueScale()
        self.average = {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}
        """Running average of the weights: what is played and saved."""
        self.teacher: TeamNetwork | None = None
        """Whom the policy is kept near, see `stay_near`."""
        self.parameters = [*network.parameters(), *critic.parameters()]
        self.optimiser = torch.optim.Adam(self.parameters, lr=settings.rate, eps=1e-5)

    def stay_near(self, weights: Mapping[str, Tensor]) -> None:
        """Take a network of the same shape as the teacher from which the policy is kept from drifting away."""
        teacher = deepcopy(self.network).requires_grad_(False)
        teacher.load_state_dict(dict(weights))
        self.teacher = to_act_in(teacher, self.precision)

    def to_act(self) -> TeamNetwork:
        """Return the network as it stands, to act with until the next step."""
        return to_act_in(self.network, self.precision)

    def values(self, experience: Experience) -> Tensor:
        """Return the critic's values of a rollout, float32, shape (t + 1, s)."""
        n_ticks = len(experience.reward)
        with torch.inference_mode(), autocast(self.device.type, self.precision):
            rows = []
            for tick in range(n_ticks + 1):
                planes, scalars = experience.last if tick == n_ticks else (experience.planes[tick], experience.scalars[tick])
                parts = (planes, experience.truth[tick], scalars)
                chunks = zip(*(torch.split(one, self.chunk) for one in parts), strict=True)
                rows.append(torch.cat([self.critic(*chunk) for chunk in chunks]))
            return torch.stack(rows).clone() * self.scale.spread + self.scale.centre

    def learn(self, experience: Experience, n_walkers: int, schedule: Schedule, generator: torch.Generator) -> dict[str, float]:
        """Take some steps on one rollout; return what they looked like.

        Raises
        ------
        TrainingError
            A loss or a gradient is not finite; no step was taken with it.
        """
        settings, experience = self.settings, experience.on(self.device)
        advantages, returns = (one.clone() for one in estimate(experience, self.values(experience), schedule, settings))
        mean, square = self.processes.mean(torch.stack([returns.mean(), returns.square().mean()])).tolist()
        explained = 1 - float((advantages.var() / returns.var().clamp_min(1e-6)).clamp_max(2))
        self.scale.note(mean, square)
        centre, deviation = self.processes.mean(torch.stack([advantages.mean(), advantages.square().mean()])).tolist()
        advantages = (advantages - centre) / max(deviation - centre**2, 1e-8) ** 0.5
        returns = (returns - self.scale.centre) / self.scale.spread
        flat = [one.flatten(0, 1) for one in (
            experience.planes, experience.truth[:-1], experience.scalars, experience.cell, experience.alive, experience.legal,
            experience.actions, experience.logp, advantages, returns,
        )]  # fmt: skip
        has_teacher = self.teacher is not None and schedule.teacher_kl > 0 and not schedule.is_critic_only
        if has_teacher:
            flat.append(self._ask_teacher(experience, n_walkers))
        for group in self.optimiser.param_groups:
            group["lr"] = schedule.rate
        sums: dict[str, float] = {}
        n_steps = 0
        for _ in range(settings.epochs):
            for rows in self.minibatches(len(flat[0]), settings.minibatch, generator):
                means = self._step([one[rows.to(self.device)] for one in flat], n_walkers, schedule)
                n_steps += 1
                for name, value in means.items():
                    sums[name] = sums.get(name, 0.0) + value
                if means["kl"] > settings.target_kl:
                    break
            if means["kl"] > settings.target_kl:
                break
        if not has_teacher:
            del sums["teacher_kl"]
        return {name: value / n_steps for name, value in sums.items()} | {"explained": explained, "steps": float(n_steps)}

    def _ask_teacher(self, experience: Experience, n_walkers: int) -> Tensor:
        """Return the teacher's log-probabilities, float32, shape (t * s, units, actions)."""
        assert self.teacher is not None
        seen = [one.flatten(0, 1) for one in (experience.planes, experience.scalars, experience.cell, experience.legal)]
        return infer_from(self.teacher, seen, n_walkers).log_softmax(-1)

    def minibatches(self, n: int, size: int, generator: torch.Generator) -> Iterator[Tensor]:
        """Yield rows in parts, as many as the settings say: every process must take as many steps as the others."""
        n_parts = min(self.processes.gather(max(round(n * self.processes.n / size), 1)) + self.processes.gather(n))
        yield from torch.randperm(n, generator=generator).tensor_split(n_parts)

    def _step(self, batch: list[Tensor], n_walkers: int, schedule: Schedule) -> dict[str, float]:
        n = len(batch[0])
        sums = torch.zeros(6, device=self.device)
        self.optimiser.zero_grad(set_to_none=True)
        for chunk in zip(*(torch.split(one, self.chunk) for one in batch), strict=True):
            loss, metrics = self._loss(list(chunk), n_walkers, schedule)
            share = len(chunk[0]) / n
            (loss * share).backward()  # type: ignore[no-untyped-call]
            sums += metrics * share
        norms = self.step()
        names = ("policy_loss", "value_loss", "entropy", "kl", "clipped", "teacher_kl")
        return dict(zip(names, self.processes.mean(sums.cpu()).tolist(), strict=True)) | norms

    def _loss(self, chunk: list[Tensor], n_walkers: int, schedule: Schedule) -> tuple[Tensor, Tensor]:
        planes, truth, scalars, cell, alive, legal, actions, old_logp, advantage, target, *taught = chunk
        with autocast(self.device.type, self.precision):
            value = self.critic(planes, truth, scalars)
            value_loss = (value - target).square().mean()
            if schedule.is_critic_only:
                return value_loss, functional.pad(value_loss.detach()[None], (1, 4))
            logits = self.network(planes, scalars, cell, legal, n_walkers)
        log_all = logits.log_softmax(-1)
        logp = log_all.gather(-1, actions[..., None]).squeeze(-1)
        weight = alive.float() / alive.float().sum().clamp_min(1)
        change = logp - old_logp
        ratio = change.exp()
        surrogate = torch.minimum(
            ratio * advantage[:, None], ratio.clamp(1 - self.settings.clip, 1 + self.settings.clip) * advantage[:, None]
        )
        policy_loss = -(surrogate * weight).sum()
        entropy = (-(log_all.exp() * log_all.clamp_min(-30)).sum(-1) * weight).sum()
        with torch.no_grad():
            kl = ((ratio - 1 - change) * weight).sum()
            clipped = (((ratio - 1).abs() > self.settings.clip).float() * weight).sum()
        loss = policy_loss + 0.5 * value_loss - schedule.entropy * entropy
        teacher_kl = torch.zeros((), device=self.device)
        for teacher_log in taught:  # one, or none
            teacher_kl = ((teacher_log.exp() * (teacher_log - log_all)).sum(-1) * weight).sum()
            loss = loss + schedule.teacher_kl * teacher_kl
        return loss, torch.stack([policy_loss.detach(), value_loss.detach(), entropy.detach(), kl, clipped, teacher_kl.detach()])

    def step(self) -> dict[str, float]:
        """Average the gradients over the processes, and take a step, if they are sound; return their norms."""
        self.processes.average_gradients(self.parameters)
        norms = {
            "actor_norm": bound_gradients(self.network.parameters(), MOST_NORM),
            "critic_norm": bound_gradients(self.critic.parameters(), MOST_NORM),
        }
        self.optimiser.step()
        with torch.no_grad():
            for name, tensor in self.network.state_dict().items():
                self.average[name].lerp_(tensor, 1 - self.settings.average)
        return norms
