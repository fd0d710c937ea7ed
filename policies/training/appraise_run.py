"""A run that learns what plans are worth, from trials.

What is learned is a value of actions, as in Q-learning (Watkins, 1989), with whole plans for actions. Playouts say what they
come to, not the network's own guess of the next state.
"""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from arena.game.ruleset import Ruleset
from arena.game.types import Team
from policies.networks.appraiser import Appraiser, AppraiserShape
from policies.networks.play_settings import PlaySettings
from policies.networks.precision import autocast
from policies.search.strategist import fresh_shape
from policies.search.trials import UNTRIED
from policies.training.appraise_settings import AppraiseSettings
from policies.training.sample_run import Rows, SampleRun
from policies.training.trials import TrialFolder, Trials, mirrored


class AppraiseRun(SampleRun[AppraiseSettings, Trials, Appraiser]):
    """Learns the mean over the plans that were tried, and how each differs from it; see `SampleRun`.

    Plans of one sample were tried in the same worlds by the same chance. So how they differ says more than what they are worth,
    and counts more: `AppraiseSettings.spread`.
    """

    method, folder_type, play = "appraise", TrialFolder, PlaySettings(temperature=0.0)
    errors = ("mean_error", "spread_error", "explained")
    """Squared errors of the mean and of the differences; and how much of the differences' squares is explained: chance makes up
    most of them, the more the fewer worlds there are."""

    def _shape(self) -> AppraiserShape:
        return fresh_shape(channels=self.settings.channels, blocks=self.settings.blocks)

    def _fresh(self) -> Appraiser:
        return Appraiser(self._shape())

    def _mirror(self, samples: Trials, which: NDArray[np.bool_]) -> Trials:
        return mirrored(samples, which)

    def _tell(self, metrics: Mapping[str, float]) -> str:
        return f"explains {metrics['explained']:.3f} of how plans differ, unseen {metrics['unseen_explained']:.3f}"

    def _loss(self, network: Appraiser, samples: Trials, rows: Rows, ruleset: Ruleset) -> tuple[Tensor, Tensor]:
        n_walkers = sum(not unit.flies for unit in ruleset.team(Team.BLUE))
        planes, scalars, cell, alive, likely, role, first, value = (
            torch.from_numpy(column[rows]).to(self.device) for column in samples
        )
        with autocast(self.device.type, self.precision):
            outlook = network.look(planes, scalars, cell.long(), alive, likely, n_walkers)
            logits = network.appraise(outlook, role.long(), first.long(), n_walkers)
        is_tried = (value != UNTRIED).float()
        n = is_tried.sum(1, keepdim=True).clamp_min(1)
        guess = torch.sigmoid(logits.float())
        mean, true_mean = ((one * is_tried).sum(1, keepdim=True) / n for one in (guess, value))
        spread, true_spread = (guess - mean) * is_tried, (value - true_mean) * is_tried
        mean_error = (mean - true_mean).square().mean()
        spread_error = ((spread - true_spread).square().sum(1, keepdim=True) / n).mean()
        there_is = (true_spread.square().sum(1, keepdim=True) / n).mean().clamp_min(1e-6)
        errors = torch.stack([mean_error, spread_error, 1 - spread_error / there_is])
        return mean_error + self.settings.spread * spread_error, errors.detach()
