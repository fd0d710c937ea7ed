"""PPO in the style of CleanRL, one file from top to bottom, on the vector form. The file is also the bot that plays the network:

python cleanrl_ppo.py 500000
arena tournament run league.toml        # with its line there
"""

import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

from arena.envs import as_observations, as_orders
from arena.policy import BatchPolicy
from policies.environments import make_vector

WEIGHTS = Path(__file__).with_suffix(".pt")
torch.set_num_threads(1)  # a venue plays on all cores by itself
NUM_ENVS, NUM_STEPS, NUM_EPOCHS, NUM_MINIBATCHES = 64, 64, 3, 8
RATE, GAMMA, GAE_LAMBDA, CLIP, ENTROPY, VALUE, MAX_NORM = 5e-4, 0.99, 0.95, 0.2, 0.01, 0.5, 0.5


class Agent(nn.Module):
    """An actor for all units of a team, and a critic."""

    def __init__(self, side=20, n_units=6, n_actions=5):
        super().__init__()
        self.shape = n_units, n_actions
        self.board = nn.Sequential(nn.Conv2d(10, 16, 3, 2, 1), nn.ReLU(), nn.Conv2d(16, 16, 3, 2, 1), nn.ReLU(), nn.Flatten())
        self.trunk = nn.Sequential(nn.Linear(16 * ((side + 3) // 4) ** 2 + 4 * n_units, 256), nn.ReLU())
        self.actor, self.critic = nn.Linear(256, n_units * n_actions), nn.Linear(256, 1)

    def forward(self, grid, units, legal):
        """Return the distribution of each unit's action, and the value, shape (n,)."""
        planes = nn.functional.one_hot(grid.long() + 1, 10).movedim(-1, 1).float()
        hidden = self.trunk(torch.cat([self.board(planes), units.flatten(1) / 20], 1))
        logits = self.actor(hidden).view(-1, *self.shape).masked_fill(legal == 0, -1e9)
        return Categorical(logits=logits), self.critic(hidden).squeeze(1)


def tensors(seen):
    return [torch.as_tensor(seen[name]) for name in ("grid", "units", "legal_actions")]


@cache
def trained():
    agent = Agent()
    agent.load_state_dict(torch.load(WEIGHTS))
    return agent


class Learned(BatchPolicy):
    def act(self, observations, orders):
        with torch.no_grad():
            choice, _ = trained()(*tensors(as_observations(observations, self.ruleset, frame="own")))
        orders[:] = as_orders(choice.logits.argmax(-1), observations)


if __name__ == "__main__":
    torch.manual_seed(1)
    n_updates = max(1, int(sys.argv[1]) // (NUM_ENVS * NUM_STEPS))
    envs = make_vector(NUM_ENVS, opponent="patrol", frame="own", autoreset_mode="SameStep")
    agent = Agent()
    optimizer = torch.optim.Adam(agent.parameters(), lr=RATE, eps=1e-5)
    seen = tensors(envs.reset(seed=1)[0])
    started, finished = time.time(), []
    returns = np.zeros(NUM_ENVS)

    for update in range(1, n_updates + 1):
        optimizer.param_groups[0]["lr"] = RATE * (1 - (update - 1) / n_updates)
        steps, ends = [], torch.zeros(NUM_STEPS, NUM_ENVS)
        rewards, values = torch.zeros(NUM_STEPS, NUM_ENVS), torch.zeros(NUM_STEPS + 1, NUM_ENVS)
        for step in range(NUM_STEPS):
            with torch.no_grad():
                choice, values[step] = agent(*seen)
                actions = choice.sample()
            steps.append((*seen, actions, choice.log_prob(actions).sum(1)))
            shown, reward, over, _, infos = envs.step(actions.numpy())
            seen, rewards[step], ends[step] = tensors(shown), torch.as_tensor(reward), torch.as_tensor(over)
            returns += reward
            finished += returns[over].tolist()
            returns[over] = 0

        with torch.no_grad():
            values[NUM_STEPS] = agent(*seen)[1]
        advantages, later = torch.zeros(NUM_STEPS, NUM_ENVS), torch.zeros(NUM_ENVS)
        for step in reversed(range(NUM_STEPS)):
            goes_on = 1 - ends[step]  # a match is never cut short: there is no final observation to value
            delta = rewards[step] + GAMMA * values[step + 1] * goes_on - values[step]
            advantages[step] = later = delta + GAMMA * GAE_LAMBDA * goes_on * later

        batch = [torch.cat(parts) for parts in zip(*steps, strict=True)]
        targets, advantages = (advantages + values[:-1]).flatten(), advantages.flatten()
        for _ in range(NUM_EPOCHS):
            for rows in torch.randperm(NUM_ENVS * NUM_STEPS).chunk(NUM_MINIBATCHES):
                grid, units, legal, actions, old = (part[rows] for part in batch)
                choice, value = agent(grid, units, legal)
                ratio = (choice.log_prob(actions).sum(1) - old).exp()
                gain = (advantages[rows] - advantages[rows].mean()) / (advantages[rows].std() + 1e-8)
                policy_loss = torch.max(-gain * ratio, -gain * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
                value_loss = (value - targets[rows]).square().mean() / 2
                loss = policy_loss + VALUE * value_loss - ENTROPY * choice.entropy().sum(1).mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), MAX_NORM)
                optimizer.step()

        n_played = update * NUM_ENVS * NUM_STEPS
        score = 100 * np.mean(finished[-200:]) if finished else float("nan")
        print(f"{n_played} steps, {n_played / (time.time() - started):.0f} a second, score of late matches {score:+.1f}")
    torch.save(agent.state_dict(), WEIGHTS)
