"""Self-play on the PettingZoo form: one network plays both teams of every match. The file is also the bot that plays it:

python selfplay_pettingzoo.py 1000
arena tournament run league.toml        # with its line there
"""

import sys
from functools import cache
from pathlib import Path

import torch
from torch import nn
from torch.distributions import Categorical

from arena.envs import as_observation, as_orders, parallel_env

WEIGHTS = Path(__file__).with_suffix(".pt")
torch.set_num_threads(1)  # a venue plays on all cores by itself
N_MATCHES, N_TICKS, RATE, GAMMA, ENTROPY = 16, 32, 5e-4, 0.99, 0.01


class Network(nn.Module):
    """Actions for all units of a team, and the value of what it sees, which is in its own frame."""

    def __init__(self, side=20, n_units=6, n_actions=5):
        super().__init__()
        self.shape = n_units, n_actions
        self.board = nn.Sequential(nn.Conv2d(10, 16, 3, 2, 1), nn.ReLU(), nn.Conv2d(16, 16, 3, 2, 1), nn.ReLU(), nn.Flatten())
        self.trunk = nn.Sequential(nn.Linear(16 * ((side + 3) // 4) ** 2 + 4 * n_units, 256), nn.ReLU())
        self.actor, self.critic = nn.Linear(256, n_units * n_actions), nn.Linear(256, 1)

    def forward(self, observations):
        grid, units, legal = (
            torch.stack([torch.as_tensor(seen[name]) for seen in observations]) for name in ("grid", "units", "legal_actions")
        )
        planes = nn.functional.one_hot(grid.long() + 1, 10).movedim(-1, 1).float()
        hidden = self.trunk(torch.cat([self.board(planes), units.flatten(1) / 20], 1))
        logits = self.actor(hidden).view(-1, *self.shape).masked_fill(legal == 0, -1e9)
        return Categorical(logits=logits), self.critic(hidden).squeeze(1)


@cache
def trained():
    network = Network()
    network.load_state_dict(torch.load(WEIGHTS))
    return network


class Learned:
    def start(self, info):
        self.ruleset = info.ruleset

    def act(self, observation):
        with torch.no_grad():
            choice, _ = trained()([as_observation(observation, self.ruleset, frame="own")])
        return as_orders(choice.logits[0].argmax(-1), observation)


if __name__ == "__main__":
    torch.manual_seed(1)
    network = Network()
    optimizer = torch.optim.Adam(network.parameters(), lr=RATE)
    envs = [parallel_env(agents="teams", frame="own") for _ in range(N_MATCHES)]
    shown = [env.reset(seed=number)[0] for number, env in enumerate(envs)]
    for update in range(1, int(sys.argv[1]) + 1):
        ticks = []
        for _ in range(N_TICKS):
            seats = [(env, team) for env in range(N_MATCHES) for team in ("blue", "red")]
            choice, values = network([shown[env][team] for env, team in seats])
            actions = choice.sample()
            told = dict(zip(seats, actions.numpy(), strict=True))
            rewards, over = torch.zeros(len(seats)), torch.zeros(len(seats))
            for number, env in enumerate(envs):
                shown[number], reward, ended, _, _ = env.step({team: told[number, team] for team in ("blue", "red")})
                for seat, team in enumerate(("blue", "red"), start=2 * number):
                    rewards[seat], over[seat] = reward[team], ended[team]
                if not env.agents:
                    shown[number], _ = env.reset()
            ticks.append((choice.log_prob(actions).sum(1), choice.entropy().sum(1), values, rewards, over))

        with torch.no_grad():
            later = network([shown[env][team] for env, team in seats])[1]
        loss = torch.tensor(0.0)
        for log_prob, entropy, values, rewards, over in reversed(ticks):
            later = rewards + GAMMA * later * (1 - over)
            gain = later - values
            loss = loss + (gain.square() / 2 - gain.detach() * log_prob - ENTROPY * entropy).mean() / N_TICKS
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 0.5)
        optimizer.step()
        if update % 50 == 0:
            n_ended = int(sum(over.sum() for *_, over in ticks)) // 2
            print(f"{update} updates, loss {loss.item():.3f}, matches that ended in the last {N_TICKS} ticks: {n_ended}")
    torch.save(network.state_dict(), WEIGHTS)
