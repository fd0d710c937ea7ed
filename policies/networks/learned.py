"""A trained network in a seat: loads a checkpoint, and plays as many seats at once as it is given."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from arena.game.observation import Observations, find_legal_actions
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.jit import jit
from arena.policy import BatchPolicy, Orders
from policies.chance import draw
from policies.networks.checkpoint import Checkpoint
from policies.networks.features import UPSIDE_DOWN, Encoded, Encoder, upside_down
from policies.networks.first_person import FirstPerson, turn_upside_down
from policies.networks.models import Net, PaperTeam, TeamNetwork, channels_last
from policies.networks.play_settings import PlaySettings, at_temperature, mean_of_logs
from policies.networks.precision import precision_of, to_act_in

CHUNK = 128
"""Seats in one pass: as many as keep what lies between the layers in the cores' own memory."""
_CHUNK_ELSEWHERE = 8192
"""Seats in one pass on a GPU, which is the faster the more it is given."""
AS_IT_IS = PlaySettings()
_SMALLEST_BF16 = 16
"""Seats from which on bf16 pays for its conversions."""


def limit_threads() -> None:
    """Keep torch to as many threads as OMP_NUM_THREADS says, or else to one: a fighter shares its machine."""
    given = os.environ.get("OMP_NUM_THREADS", "")
    torch.set_num_threads(int(given) if given.isdigit() and int(given) > 0 else 1)


def device_of(network: nn.Module) -> torch.device:
    """Return where a network computes."""
    return next(network.parameters()).device


def chunk_on(device: torch.device) -> int:
    """Return how many seats one pass takes on a device."""
    return CHUNK if device.type == "cpu" else _CHUNK_ELSEWHERE


def _to_act_in_seats(network: Net, n_seats: int) -> Net:
    return to_act_in(network, precision_of(device_of(network).type)) if n_seats >= _SMALLEST_BF16 else network


@jit()
def choose(logits: Any, seeds: Any, actions: Any) -> None:
    """Draw an action for each unit, with chance from the seat's own seed of the tick.

    Parameters
    ----------
    logits
        float32, shape (n, units, actions).
    seeds
        uint64, shape (n,).
    actions
        int8, shape (n, units): written.
    """
    n_actions = logits.shape[2]
    for seat in range(logits.shape[0]):
        for unit in range(logits.shape[1]):
            line = logits[seat, unit]
            most = line[0]
            for action in range(1, n_actions):
                most = max(most, line[action])
            total = 0.0
            for action in range(n_actions):
                total += np.exp(np.float64(line[action] - most))
            left = draw(seeds[seat], unit)[3] / 4294967296.0 * total
            actions[seat, unit] = 0
            for action in range(n_actions):
                weight = np.exp(np.float64(line[action] - most))
                if weight > 0:
                    actions[seat, unit] = action
                    if left < weight:
                        break
                left -= weight


class LearnedTeam(BatchPolicy):
    """Plays a `TeamNetwork`, which may be exchanged while matches run."""

    def __init__(
        self, ruleset: Ruleset, team: Team, n_seats: int, *, network: TeamNetwork, play: PlaySettings = AS_IT_IS
    ) -> None:
        super().__init__(ruleset, team, n_seats)
        self._play = play
        self._encoder = Encoder(ruleset, team, n_seats)
        self._n_walkers = sum(not unit.flies for unit in ruleset.team(team))
        self._actions = np.zeros((n_seats, len(ruleset.team(team))), np.int8)
        self.use(network)

    def use(self, network: TeamNetwork) -> None:
        """Play with another network from now on."""
        self._network = channels_last(network.eval())
        self._fast = _to_act_in_seats(self._network, self.n_seats)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what was seen there."""
        self._encoder.start(seats)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Encode all seats, think about them in chunks, and draw."""
        if not orders.shape[1]:
            return
        logits = at_temperature(self._think(self._encoder.encode(observations)), self._play.temperature)
        choose(logits, np.ascontiguousarray(observations.seed), self._actions)
        orders[:] = self._encoder.to_board(self._actions)

    def _think(self, encoded: Encoded) -> NDArray[np.float32]:
        if not self._play.mirror:
            return infer(self._fast, encoded, self._n_walkers)
        both = Encoded(*(np.concatenate([one, other]) for one, other in zip(encoded, upside_down(encoded), strict=True)))
        logits, turned = np.split(infer(self._fast, both, self._n_walkers), 2)
        return mean_of_logs(logits, turned[..., UPSIDE_DOWN])


def infer(network: TeamNetwork, encoded: Encoded, n_walkers: int) -> NDArray[np.float32]:
    """Return logits, float32, shape (n, units, actions), computed on the network's own device."""
    arrays = (encoded.planes, encoded.scalars, encoded.cell, encoded.legal)
    return np.asarray(infer_from(network, [torch.from_numpy(array) for array in arrays], n_walkers).cpu().numpy())


def infer_from(network: TeamNetwork, seen: Sequence[Tensor], n_walkers: int) -> Tensor:
    """Return logits as `infer` does, in chunks, where the network computes, of what `TeamNetwork.forward` takes."""
    device = device_of(network)
    with torch.inference_mode():
        chunks = zip(*(torch.split(one.to(device), chunk_on(device)) for one in seen), strict=True)
        return torch.cat([network(*chunk, n_walkers) for chunk in chunks])


class LearnedUnits(BatchPolicy):
    """Plays a `PaperTeam`, which may be exchanged while matches run: each unit decides alone, from its own view."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, *, network: PaperTeam, play: PlaySettings = AS_IT_IS) -> None:
        super().__init__(ruleset, team, n_seats)
        self._play = play
        self._flies = np.array([unit.flies for unit in ruleset.team(team)], np.uint8)
        self._views = FirstPerson(team, ruleset.side, self._flies, n_seats, network.window, network.edge)
        self._actions = np.zeros((n_seats, len(self._flies)), np.int8)
        self._unit = torch.arange(len(self._flies)).repeat(n_seats)
        self.use(network)

    def use(self, network: PaperTeam) -> None:
        """Play with another network from now on."""
        self._network = channels_last(network.eval())
        self._fast = _to_act_in_seats(self._network, self.n_seats)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Cut the views, and draw from what the network gives; a step that it cannot take is staying."""
        if not orders.size:
            return
        logits = at_temperature(self._think(observations), self._play.temperature)
        choose(logits, np.ascontiguousarray(observations.seed), self._actions)
        drawn = self._views.to_board(self._actions)
        legal = find_legal_actions(observations.ground, observations.side, observations.cell, observations.alive, self._flies)
        orders[:] = np.where(np.take_along_axis(legal, drawn[..., None].astype(np.int64), 2)[..., 0], drawn, Action.STAY)

    def _think(self, observations: Observations) -> NDArray[np.float32]:
        logits = self._infer(observations)
        if not self._play.mirror:
            return logits
        return mean_of_logs(logits, self._infer(turn_upside_down(observations))[..., UPSIDE_DOWN])

    def _infer(self, observations: Observations) -> NDArray[np.float32]:
        views = torch.from_numpy(self._views.cut(observations)).flatten(0, 1)
        return infer_units(self._fast, views, self._unit).reshape(*self._actions.shape, -1)


def infer_units(network: PaperTeam, views: Tensor, unit: Tensor) -> NDArray[np.float32]:
    """Return logits of views of units, float32, shape (n, actions), computed in chunks, on the network's own device."""
    device = device_of(network)
    with torch.inference_mode():
        chunks = zip(*(torch.split(one.to(device), chunk_on(device)) for one in (views, unit)), strict=True)
        return np.asarray(torch.cat([network(*chunk) for chunk in chunks]).cpu().numpy())


@dataclass(frozen=True, slots=True)
class LearnedFactory:
    """The `BatchFactory` of a checkpoint. Reading the file is what takes long, and is done before any seat is asked for."""

    is_ours: ClassVar[bool] = True
    checkpoint: Checkpoint
    play: PlaySettings
    name: str
    most_seats: int = 256

    def with_settings(self, text: str) -> "LearnedFactory":
        """Return the same network played otherwise; see `PlaySettings.with_`."""
        return replace(self, play=self.play.with_(self.name, text))

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        """Return the network in some seats."""
        network = self.checkpoint.network
        if isinstance(network, PaperTeam):
            return LearnedUnits(ruleset, team, n_seats, network=network, play=self.play)
        assert isinstance(network, TeamNetwork)  # the caller has looked
        return LearnedTeam(ruleset, team, n_seats, network=network, play=self.play)


def load_learned(checkpoint: Checkpoint, path: Path) -> LearnedFactory:
    """Return the fighter of a checkpoint of a network that gives orders itself."""
    limit_threads()
    return LearnedFactory(checkpoint, checkpoint.manifest.play, path.stem)
