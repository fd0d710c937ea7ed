"""PPO of Stable-Baselines3 against `patrol`. This one file trains the network, and is the bot that plays it:

python sb3_ppo.py 500000
arena tournament run league.toml
"""

import sys
from functools import cache
from pathlib import Path

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch.nn import Conv2d, Flatten, Linear, ReLU, Sequential

from arena.envs import as_observations, as_orders
from arena.policy import BatchPolicy
from policies.environments import make_sb3

MODEL = Path(__file__).with_suffix(".zip")
torch.set_num_threads(1)  # a venue plays on all cores by itself


class Eyes(BaseFeaturesExtractor):
    """A plane of the board for each code, and the own units."""

    def __init__(self, space):
        super().__init__(space, 256)
        n_features = 16 * ((space["grid"].shape[0] + 3) // 4) ** 2 + space["units"].low.size
        self.board = Sequential(Conv2d(10, 16, 3, 2, 1), ReLU(), Conv2d(16, 16, 3, 2, 1), ReLU(), Flatten())
        self.all = Sequential(Linear(n_features, 256), ReLU())

    def forward(self, seen):
        planes = torch.nn.functional.one_hot(seen["grid"].long() + 1, 10).movedim(-1, 1).float()
        return self.all(torch.cat([self.board(planes), seen["units"].flatten(1) / 20], 1))


@cache
def trained():
    return PPO.load(MODEL, device="cpu")


class Learned(BatchPolicy):
    def act(self, observations, orders):
        seen = as_observations(observations, self.ruleset, frame="own")
        orders[:] = as_orders(trained().predict(seen, deterministic=True)[0], observations)


if __name__ == "__main__":
    env = make_sb3(32, opponent="patrol", frame="own")
    model = PPO("MultiInputPolicy", env, n_steps=64, batch_size=512, policy_kwargs={"features_extractor_class": Eyes})
    model.learn(int(sys.argv[1]))
    model.save(MODEL)
