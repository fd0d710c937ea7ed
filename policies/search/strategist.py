"""Lets a trained network choose who attacks, guards or hunts: it values every team's roles, where `planner-fast` plays them on.

The network says what a plan is worth (`policies.networks.appraiser`), by what was seen and by how likely each model of the enemy
is in the worlds that may be. The best of the blueprint's orders, the plan of the tick before and the presets is improved unit by
unit, as `policies.search.climb` does; the roles themselves say what to order, as they do in playouts.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from arena.errors import PolicyError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import BatchPolicy, Orders
from policies.networks.appraisal import Appraisal
from policies.networks.appraiser import Appraiser, AppraiserShape
from policies.networks.checkpoint import Checkpoint
from policies.networks.features import Encoder, mirror
from policies.networks.learned import limit_threads
from policies.networks.play_settings import PlaySettings
from policies.search.climb import BEST, BLUEPRINT, FLIES, LAST, PRESETS, TRIALS, WALKS, Effort, write_presets
from policies.search.explain import explain
from policies.search.mind import Mind
from policies.search.models import NAMES, RUSH, SCOUT, Role, shares_of_models
from policies.search.planner import can_look_ahead
from policies.search.plans import FROM_ROLE

_WHOLE = np.array([BLUEPRINT, LAST, *range(PRESETS, TRIALS)])
"""Rows of the plans from which the climb begins."""
_KEPT = np.float32(0.04)
"""By how much another plan must be worth more, as a logit, than that of the tick before, and than the one that is climbed from:
what the network takes for less is mostly its error."""
_EFFORT = Effort.of(1)
"""How worlds go on; nothing is played out."""


class Strategist(BatchPolicy):
    """Plays an `Appraiser`."""

    n_worlds: ClassVar[int] = 64

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, *, network: Appraiser, play: PlaySettings, name: str) -> None:
        super().__init__(ruleset, team, n_seats)
        self._temperature = play.temperature
        self._effort = _EFFORT if can_look_ahead(name, ruleset) else _EFFORT._replace(budget=0)
        self.minds = [Mind(ruleset, team, self.n_worlds, 1) for _ in range(n_seats)]
        self.encoder = Encoder(ruleset, team, n_seats)
        self.likely = np.zeros((n_seats, len(NAMES)), np.float32)
        """Shape (n_seats, models): how likely the enemy plays by each, as the network takes it."""
        self._flies = [unit.flies for unit in ruleset.team(team)]
        self._appraisal = Appraisal(network, self._flies.count(False), is_mirrored=play.mirror)
        self._is_alone = all(unit.flies for unit in ruleset.team(team.other))
        self._notes = [b""] * n_seats

    def start(self, seats: NDArray[np.intp]) -> None:
        """Forget what some seats have in mind."""
        for seat in np.arange(self.n_seats)[seats].tolist():
            self.minds[seat].start()
        self.encoder.start(seats)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats."""
        if not orders.size:
            return
        if not self._effort.budget:
            for seat, mind in enumerate(self.minds):
                orders[seat] = mind.act(observations.select(slice(seat, seat + 1)), self._effort, None)
            return
        self.take_in(observations)
        role, first, value = self._run() if self._is_alone else self._choose(observations.seed)
        for seat, mind in enumerate(self.minds):
            plans = mind.plans[0]
            plans.role[BEST], plans.first[BEST], plans.goal[BEST] = role[seat], first[seat], -1
            plans.value[BEST, 0], plans.n_tried[BEST] = value[seat], 1
            orders[seat] = mind.carry_out(BEST)
            if self.keeps_annotations and self.explains:
                self._notes[seat] = explain(mind.tell()).pack()

    def take_in(self, observations: Observations) -> None:
        """Encode what is seen, let the worlds that may be go on, and write the plans from which the climb begins."""
        self.encoded = self.encoder.encode(observations)
        for seat, mind in enumerate(self.minds):
            mind.take_in(observations.select(slice(seat, seat + 1)), self._effort)
            write_presets(int(self.team), mind.plans[0], mind.benches[0])
            self.likely[seat] = shares_of_models(mind.benches[0].now, self.team.other)

    def take_annotations(self, seat: int) -> bytes:
        """Return what a seat thought in the last `act`, and forget it."""
        taken, self._notes[seat] = self._notes[seat], b""
        return taken

    def _run(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
        """Return what `_choose` does where no enemy can stop anybody on foot: playouts teach nothing about that, and all run."""
        kinds = [SCOUT if flies else RUSH for flies in self._flies]
        role = np.tile(np.array(kinds, np.int64), (self.n_seats, 1))
        return role, np.full_like(role, FROM_ROLE), np.ones(self.n_seats, np.float32)

    def _choose(self, seeds: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
        """Return the role and the first order of each unit, shape (n_seats, units), and what the network makes of that."""
        plans, everyone = [mind.plans[0] for mind in self.minds], np.arange(self.n_seats)
        is_turned = self.encoder.is_turned[:, None]
        self._appraisal.look(self.encoded, self.likely)
        chance = Draws(seeds, self._temperature, max(len(_WHOLE), 1 + len(WALKS), 1 + len(FLIES)))

        def weigh(
            role: NDArray[np.int64], first: NDArray[np.int64], is_kept: NDArray[np.bool_]
        ) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
            """Return the logits of some plans of each seat, and which it takes."""
            logits = self._appraisal.logits(role, first)
            return logits, (logits + _KEPT * is_kept + chance.draw()[:, : len(is_kept)]).argmax(1)

        role = np.stack([one.role[_WHOLE] for one in plans]).astype(np.int64)
        first = to_frame(np.stack([one.first[_WHOLE] for one in plans]).astype(np.int64), is_turned[..., None])
        logits, best = weigh(role, first, _WHOLE == LAST)
        for seat, one in enumerate(plans):
            one.value[_WHOLE, 0], one.n_tried[_WHOLE] = _share(logits[seat]), 1
        role, first = role[everyone, best], first[everyone, best]
        for unit, flies in enumerate(self._flies):
            roles = FLIES if flies else WALKS
            some_roles, some_firsts = (np.repeat(one[:, None], 1 + len(roles), 1) for one in (role, first))
            some_roles[:, 1:, unit], some_firsts[:, 1:, unit] = roles, FROM_ROLE
            logits, best = weigh(some_roles, some_firsts, np.arange(1 + len(roles)) == 0)
            role, first = some_roles[everyone, best], some_firsts[everyone, best]
        return role, to_frame(first, is_turned), _share(logits[everyone, best])


def to_frame(first: NDArray[np.int64], is_turned: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return first orders on the board, shape (..., units), as actions of the frame, or these as orders.

    Parameters
    ----------
    is_turned
        Whether the frame is the board's mirror image; of a shape to which that of the orders can be broadcast.
    """
    return np.where(is_turned & (first != FROM_ROLE), mirror(np.maximum(first, 0)), first)


class Draws:
    """Chance for the choices of a tick: with it, the largest is a draw at the temperature (Gumbel, 1954)."""

    def __init__(self, seeds: NDArray[np.uint64], temperature: float, n_choices: int) -> None:
        self._shape, self._temperature = (len(seeds), n_choices), temperature
        self._of_seat = [np.random.default_rng(int(seed)) for seed in seeds] if temperature else []

    def draw(self) -> NDArray[np.float64]:
        """Return what to add to the logits of the next choice, shape (n_seats, n_choices)."""
        if not self._of_seat:
            return np.zeros(self._shape)
        return self._temperature * np.stack([rng.gumbel(size=self._shape[1]) for rng in self._of_seat])


def _share(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return shares of a win as their logits say them."""
    share: NDArray[np.float32] = np.float32(0.5) + np.float32(0.5) * np.tanh(np.float32(0.5) * logits)
    return share


@dataclass(frozen=True, slots=True)
class StrategistFactory:
    """The `BatchFactory` of a checkpoint of an `Appraiser`."""

    is_ours: ClassVar[bool] = True
    network: Appraiser
    play: PlaySettings
    name: str
    most_seats: int = 64

    def with_settings(self, text: str) -> "StrategistFactory":
        """Return the same network played otherwise; see `PlaySettings.with_`."""
        return replace(self, play=self.play.with_(self.name, text))

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        """Return the network in some seats."""
        return Strategist(ruleset, team, n_seats, network=self.network, play=self.play, name=self.name)


def fresh_shape(**sizes: int) -> AppraiserShape:
    """Return the shape of a network that knows the roles and the models of today; other sizes are the defaults."""
    return AppraiserShape(**sizes, roles=len(Role), models=len(NAMES))


def load_strategist(checkpoint: Checkpoint, path: Path) -> StrategistFactory:
    """Return the fighter of a checkpoint of an `Appraiser`.

    Raises
    ------
    PolicyError
        It is of other roles, or other models of the enemy.
    """
    limit_threads()
    network = checkpoint.network
    assert isinstance(network, Appraiser)  # the caller has looked
    shape, wanted = network.shape, fresh_shape()
    if (shape.roles, shape.models) != (wanted.roles, wanted.models):
        raise PolicyError(
            f"the checkpoint {path} knows {shape.roles} roles and {shape.models} models of the enemy; this arena has "
            f"{wanted.roles} and {wanted.models}"
        )
    return StrategistFactory(network, checkpoint.manifest.play, path.stem)
