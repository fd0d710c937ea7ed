"""What a step of PPO is made of: gradients that are cut apart."""

import pytest
import torch
from small import make_learner
from torch import nn

from policies.training.ppo import MOST_NORM


def norm_of(network: nn.Module) -> float:
    return float(torch.stack([one.grad.norm() for one in network.parameters() if one.grad is not None]).norm())


def test_what_the_critic_gets_wrong_takes_nothing_from_the_actors_step() -> None:
    learner = make_learner()
    for network, norm in ((learner.network, 0.8 * MOST_NORM), (learner.critic, 60.0)):
        for one in network.parameters():
            one.grad = torch.ones_like(one)
        by = norm / norm_of(network)
        for one in network.parameters():
            one.grad *= by

    found = learner.step()

    assert norm_of(learner.network) == pytest.approx(0.8 * MOST_NORM, rel=1e-3)
    assert norm_of(learner.critic) == pytest.approx(MOST_NORM, rel=1e-3)
    assert found == {"actor_norm": pytest.approx(0.8 * MOST_NORM, rel=1e-3), "critic_norm": pytest.approx(60.0, rel=1e-3)}
