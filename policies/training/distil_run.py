"""A run that learns what a teacher would have ordered, from demonstrations.

Of a teacher that is unsure, its chances are learned beside its orders. Source: Hinton, Vinyals, Dean, "Distilling the knowledge
in a neural network" (2015). A network that is taught what a search makes of the positions that it gets itself into is expert
iteration: Anthony, Tian, Barber, "Thinking fast and slow with deep learning and tree search" (2017).
"""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from policies.networks.judges import Judge, Locator
from policies.networks.models import TeamNetwork, TeamShape
from policies.networks.precision import autocast
from policies.training.demonstrations import CERTAIN, DemonstrationFolder, Demonstrations, mirrored
from policies.training.distil_settings import DistilSettings
from policies.training.sample_run import Rows, SampleRun


class DistilRun(SampleRun[DistilSettings, Demonstrations, TeamNetwork]):
    """Learns orders, and beside them the match's end and where the enemy is; see `SampleRun`."""

    method, folder_type = "distil", DemonstrationFolder
    errors = ("loss", "agreed", "value_loss", "belief_loss")
    """Cross entropies in nats, the share of orders that are the teacher's, a squared error."""

    def _shape(self) -> TeamShape:
        return TeamShape(channels=self.settings.channels, blocks=self.settings.blocks)

    def _fresh(self) -> TeamNetwork:
        return TeamNetwork(self._shape())

    def _heads(self) -> dict[str, nn.Module]:
        self.judge, self.locator = Judge(self._shape()), Locator(self._shape())
        return {"judge": self.judge, "locator": self.locator}

    def _mirror(self, samples: Demonstrations, which: NDArray[np.bool_]) -> Demonstrations:
        return mirrored(samples, which)

    def _tell(self, metrics: Mapping[str, float]) -> str:
        return f"agrees with the teacher in {metrics['agreed']:.3f}, unseen {metrics['unseen_agreed']:.3f}"

    def _loss(self, network: TeamNetwork, samples: Demonstrations, rows: Rows, ruleset: Ruleset) -> tuple[Tensor, Tensor]:
        n_walkers = sum(not unit.flies for unit in ruleset.team(Team.BLUE))
        planes, scalars, cell, legal, labels, chances, enemies, outcome = (
            torch.from_numpy(column[rows]).to(self.device) for column in samples
        )
        with autocast(self.device.type, self.precision):
            values, board = network.look(planes, scalars)
            logits = network.decide(values, board, cell.long(), legal, n_walkers)
            value, places = self.judge(board, scalars), self.locator(board)
        is_known = (labels >= 0).float()
        sure = functional.one_hot(labels.long().clamp_min(0), logits.shape[-1]).float()
        chances = chances.float() / chances.float().sum(-1, keepdim=True).clamp_min(1 / CERTAIN)
        target = sure.lerp(chances, self.settings.soft)
        n = is_known.sum().clamp_min(1)
        loss = -((target * logits.log_softmax(-1)).sum(-1) * is_known).sum() / n
        agreed = ((logits.argmax(-1) == labels) * is_known).sum() / n
        value_loss = (value - outcome).square().mean()
        there = enemies.flatten(1, 2).float()
        belief_loss = -(there * places.log_softmax(1)).sum() / there.sum().clamp_min(1)
        whole = loss + self.settings.value * value_loss + self.settings.belief * belief_loss
        return whole, torch.stack([loss.detach(), agreed, value_loss.detach(), belief_loss.detach()])
