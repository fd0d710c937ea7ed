"""The paper's method: REINFORCE with first-person observations, experience replay and a policy that every unit carries.

Source: paper, Algorithm 1 and Table 3. Read aloud, line by line, with the switch of `ReinforceSettings` wherever there are two
ways to read it:

*while k < N_episodes; if k = K_update.* Ten matches are played with one policy, then there is one update (`update_every`,
`updates`). "Episode length 100" is the tick limit of the ruleset.

*Split s_1 .. s_agents = tau(t).* Each living unit's tick is a sample. A fallen unit has nothing to decide, so its samples
stop; the team's reward goes on to the end of the match, "that would allow the agents to learn to sacrifice themselves".

*R.* Equation 4 calls the score of the game the reward, a step function "that remains unchanged till the next score change";
section 3 says that "this final reward at the end of each experiment has been discounted by time". `reward=terminal` pays the
final score at the last tick; `stream` pays the score as it stands after every tick, which is Equation 4 put into the sum of
Algorithm 1; `differences` pays every change of the score once, as it happens, and is what most would write today. All are in
points, -100 to 100. `stall` pays so much more at the last tick of a match that runs out, which is usually a penalty.

*Sample buffer s, R, t ~ B(U(0, N_buffer)).* The replay is uniform, and the gradient of REINFORCE is right only for samples of
the policy that is updated. With Table 3 an update adds some 4,000 samples to 50,000, so that a sample is drawn for about a
dozen updates after it was made: the gradient is off-policy by as much as the policy moves in them. `importance=0` does as the
paper writes, `importance=c` weighs each sample by pi/mu, at most c, where mu drew it. Metrics show how far it is in any case:
mean age in updates, mean log mu - log pi, and the share of the batch that is left as effective sample size.

*G = sum of gamma^(k-t-1) R_k.* The return from t on. `standardise=trajectory` gives the returns of each unit in each match mean 0
and standard deviation 1, which leaves only what changes within a match, and credits none where nothing did.

*theta = theta + alpha gamma^t G grad log pi.* `discount_steps` is the gamma^t. With a terminal reward, gamma^t times
gamma^(T-t-1) R_T is gamma^(T-1) R_T: every step of a match gets the same credit, first and last, good and bad, and only
matches that end sooner or better tell anything. The paper has no baseline: where no match can be lost, as in `exp1`, no credit
is ever below 0, and whatever was done becomes likelier. `baseline=mean` subtracts the mean return of the batch; `normalise`
divides by the standard deviation. The formula is plain ascent for one sample; `optimiser=ascent` takes that step for the sum
of the batch, `optimiser=adam`, the default, gives the mean gradient to Adam: public sketches by the authors from that time
(osipychev/ctf_public, folder pg) use Adam, and RMSProp at the rate of Table 3.

*Each agent carries its own policy.* The paper has also "a mutual policy", and units that "work in any number from 1 to N".
`policies=shared` gives all the same weights, `policies=each` has a network for each index of a unit.

*Figure 3, the board of codes.* A unit's view is one plane of the codes of Table 2, as they stand. A convolution finds it hard to
tell 7, the flag, from 8, an obstacle; `codes=planes` gives each code a plane of its own, and `codes=signed` has six planes: what
is hidden, ground, units on foot, units in the air, flags and obstacles, each 1 where it is own or nobody's, and -1 where it is
the enemy's. What lies off the board is hidden as well, or with `edge=obstacle` an obstacle.

*The nearest code that is public*, a notebook of 2018 in a fork of ctf_public (skim0119/ctf_public, ctf_train.ipynb), has the
numbers of Table 3 and reads the rest otherwise: `window=21`, `edge=obstacle`, `codes=signed`, `discount_steps=false`,
`reward=differences`, `stall=-30`, a batch for every match, whose gradients are added up to the next update (`batch=20000`), and
20 matches at random before all (`warmup=20`). Its versions disagree on whether hidden cells, obstacles and own ground show as 0
or 1; `signed` shows all of them.

*Self-play: after the policy update, we upgraded the policy of the opponent team with the current best model.* `opponent=self`
plays against the policy of the last update; any other name is a fighter. What the opponent sees is not learned from.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from policies.networks.learned import CHUNK
from policies.networks.models import PaperTeam, channels_last
from policies.networks.precision import autocast, precision_of, to_act_in
from policies.training.gradients import bound_gradients
from policies.training.parallel import Processes
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.replay import Replay, Samples

_CPU_CHUNK = 8 * CHUNK
"""Samples in one pass of back-propagation on a CPU: more would no longer fit its caches."""
_ALIKE = 1e-6
"""A standard deviation below this is none."""

METRICS = ("entropy", "gap", "effective", "credit", "credit_spread", "norm", "age")
"""What an update tells of itself."""


def credit(
    stream: NDArray[np.float64], length: NDArray[np.int64], reward: str, gamma: float, extra: NDArray[np.float64] | float = 0.0
) -> NDArray[np.float64]:
    """Return G of Algorithm 1 for every tick.

    Parameters
    ----------
    stream
        Shape (t, n): the score of n matches after each tick; what follows a match's end does not count.
    length
        Shape (n,): ticks of each match.
    reward
        A reading of R, see `ReinforceSettings.reward`.
    extra
        Shape (n,): what the last tick of each match pays besides.

    Returns
    -------
    ndarray
        Shape (t, n).
    """
    ticks = np.arange(len(stream))[:, None]
    if reward == "terminal":
        paid = np.where(ticks == length - 1, stream, 0.0)
    elif reward == "stream":
        paid = np.where(ticks < length, stream, 0.0)
    else:
        paid = np.where(ticks < length, np.diff(stream, axis=0, prepend=0.0), 0.0)
    paid = paid + np.where(ticks == length - 1, extra, 0.0)
    returned = np.zeros_like(paid)
    ahead = np.zeros(paid.shape[1])
    for tick in reversed(range(len(paid))):
        ahead = paid[tick] + gamma * ahead
        returned[tick] = ahead
    return returned


def standardise(returned: NDArray[np.float64], trajectory: NDArray[np.int64]) -> NDArray[np.float64]:
    """Give the returns of each trajectory mean 0 and standard deviation 1; those that are all alike become 0.

    Parameters
    ----------
    trajectory
        Shape (n,): the number of the trajectory that each sample belongs to, from 0.
    """
    n = np.maximum(np.bincount(trajectory), 1)
    apart = returned - (np.bincount(trajectory, returned) / n)[trajectory]
    spread = np.sqrt(np.bincount(trajectory, apart**2) / n)
    return np.asarray(apart / np.maximum(spread, _ALIKE)[trajectory])


class Reinforcer:
    """The policy, its replay and its optimiser."""

    def __init__(self, network: PaperTeam, settings: ReinforceSettings, processes: Processes, device: str = "cpu") -> None:
        self.network = channels_last(network.to(device))
        self.settings, self.processes, self.device = settings, processes, torch.device(device)
        self.parameters = list(network.parameters())
        make = torch.optim.Adam if settings.optimiser == "adam" else torch.optim.SGD
        self.optimiser: torch.optim.Optimizer = make(self.parameters, lr=settings.rate, fused=True)
        _, capacity = processes.share(settings.buffer)
        self.replay = Replay(max(capacity, 1))
        self.precision = precision_of(device) if settings.bf16 else torch.float32

    def to_act(self) -> PaperTeam:
        """Return the network as it stands, to act with until the next step."""
        return to_act_in(self.network, self.precision)

    def update(self, n_updates: int, rng: np.random.Generator) -> dict[str, float]:
        """Draw a batch and take a step, as often as the settings say; return what it looked like.

        Parameters
        ----------
        n_updates
            Updates that the policy has behind it.

        Raises
        ------
        TrainingError
            The gradient is not finite, or has exploded; no step was taken with it.
        """
        _, size = self.processes.share(self.settings.batch)
        steps: list[dict[str, float]] = []
        for _ in range(self.settings.updates):
            batch = self.replay.draw(max(size, 1), rng)
            metrics = self.backward(batch)
            self.processes.average_gradients(self.parameters)
            metrics["norm"] = bound_gradients(self.parameters)
            metrics["age"] = float(n_updates - batch.update.double().mean())
            self.optimiser.step()
            steps.append(metrics)
        names = list(steps[0])
        means = self.processes.mean(torch.tensor([np.mean([one[name] for one in steps]) for name in names]))
        return dict(zip(names, means.tolist(), strict=True))

    def backward(self, batch: Samples) -> dict[str, float]:
        """Put the gradient of minus the paper's objective into the parameters, for a batch of this process."""
        self.optimiser.zero_grad(set_to_none=True)
        weights = self.weights(batch)
        size = _CPU_CHUNK if self.device.type == "cpu" else len(weights)
        sums = torch.zeros(4, device=self.device)
        parts = (batch.views, batch.unit, batch.action, batch.logp, weights)
        for chunk in zip(*(torch.split(one.to(self.device), size) for one in parts), strict=True):
            loss, metrics = self._loss(*chunk)
            # `average_gradients` takes a mean over the processes, which a sum over the batch must undo.
            scale = 1 / len(weights) if self.settings.optimiser == "adam" else float(self.processes.n)
            (loss * scale).backward()  # type: ignore[no-untyped-call]
            sums += metrics
        entropy, gap, ratio, square = sums.tolist()
        n = len(weights)
        return {
            "entropy": entropy / n, "gap": gap / n, "effective": ratio**2 / max(n * square, 1e-12),
            "credit": float(weights.mean()), "credit_spread": float(weights.std()),
        }  # fmt: skip

    def weights(self, batch: Samples) -> Tensor:
        """Return what each sample's gradient is multiplied with, importance left out; float32, shape (n,)."""
        returned = batch.returned
        if self.settings.baseline == "mean":
            returned = returned - returned.mean()
        if self.settings.normalise:
            returned = returned / returned.std().clamp_min(1e-6)
        return returned * self.settings.gamma**batch.tick if self.settings.discount_steps else returned

    def _loss(self, views: Tensor, unit: Tensor, action: Tensor, old: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
        """Return minus the objective, summed, and sums of entropy, log mu - log pi, importance weights and their squares."""
        with autocast(self.device.type, self.precision):
            logits = self.network(views, unit)
        log_all = logits.log_softmax(-1)
        logp = log_all.gather(1, action[:, None]).squeeze(1)
        entropy = -(log_all.exp() * log_all).sum(-1)
        with torch.no_grad():
            ratio = (logp - old).exp()
        used = ratio.clamp_max(self.settings.importance) if self.settings.importance else torch.ones_like(ratio)
        loss = -(used * weight * logp + self.settings.entropy * entropy).sum()
        metrics = [entropy.detach().sum(), (old - logp.detach()).sum(), ratio.sum(), ratio.square().sum()]
        return loss, torch.stack(metrics)
