"""Behaviour cloning: the network learns to order what a script would have ordered, in the situations that it gets itself into.

Source: Ross, Gordon, Bagnell, "A reduction of imitation learning and structured prediction to no-regret online learning" (DAgger,
2011). After a while of watching, the learner plays most matches itself, while the script goes on saying what it would have done.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from arena.envs.batched import StepResult
from arena.game.observation import Observations
from arena.game.types import Action, Team
from policies.networks.features import N_PLANES, N_SCALARS
from policies.networks.learned import choose, infer
from policies.networks.models import TeamNetwork
from policies.networks.precision import autocast
from policies.registry import load
from policies.search.planner import Planner
from policies.training.opponents import Seated
from policies.training.ppo import Learner
from policies.training.rollout import Actors, LearnerSeats, Results

WATCHING = 0.15
"""Share of the samples in which the script plays all matches."""
OWN_SEATS = 0.7
"""Share of the seats that the learner plays after that."""
_NO_LABEL = -100


class Teacher:
    """A script that says what it would do in each of the learner's seats."""

    def __init__(self, name: str, seats: LearnerSeats) -> None:
        ruleset, self._seats = seats.env.ruleset, seats
        make, n_red = load(name), len(seats.opponents.self_rows)
        self._blue = Seated(name, make(ruleset, Team.BLUE, seats.env.n_games), np.arange(seats.env.n_games))
        self._red = Seated(name, make(ruleset, Team.RED, n_red), seats.opponents.self_rows) if n_red else None
        self._orders = np.zeros((seats.n_seats, seats.n_units), np.int8)

    def label(self, seen: dict[Team, Observations]) -> NDArray[np.int8]:
        """Return the script's actions in the frame, shape (s, units)."""
        n_games = self._seats.env.n_games
        self._blue.fighter.act(seen[Team.BLUE], self._orders[:n_games])
        if self._red is not None:
            self._red.fighter.act(seen[Team.RED].select(self._red.rows), self._orders[n_games:])
        return self._seats.to_frame(np.clip(self._orders, 0, len(Action) - 1))

    def chances(self) -> NDArray[np.float32]:
        """Return the chances of each action of the frame after `label`, shape (s, units, actions); a script is sure."""
        chances = np.eye(len(Action), dtype=np.float32)[np.clip(self._orders, 0, len(Action) - 1)]
        for seat, (planner, its_seat) in self._planners():
            chances[seat] = planner.first_steps(its_seat)
        actions = np.tile(np.arange(len(Action), dtype=np.int8), (self._seats.n_seats, 1))
        framed: NDArray[np.float32] = np.take_along_axis(chances, self._seats.to_frame(actions)[:, None].astype(np.int64), 2)
        return framed

    def hear(self, actions: NDArray[np.int8]) -> None:
        """Tell a planner what was done in its place after `label`: actions of the frame, shape (s, units)."""
        orders = self._seats.to_frame(actions)
        for seat, (planner, its_seat) in self._planners():
            planner.hear(its_seat, orders[seat])

    def _planners(self) -> Iterator[tuple[int, tuple[Planner, int]]]:
        fighters = [one.fighter for one in (self._blue, self._red) if one is not None]
        seats = [(fighter, seat) for fighter in fighters for seat in range(fighter.n_seats)]
        yield from ((at, (fighter, seat)) for at, (fighter, seat) in enumerate(seats) if isinstance(fighter, Planner))

    def start(self, turn: StepResult) -> None:
        """Start a new match where the tick ended one."""
        self._blue.start(turn)
        if self._red is not None:
            self._red.start(turn)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lesson:
    """What the learner saw, and what the script would have done."""

    planes: Tensor
    scalars: Tensor
    cell: Tensor
    legal: Tensor
    labels: Tensor
    """int64, shape (t * s, units): an action of the frame, or what cross entropy ignores where there is nothing to learn."""


def _join(lessons: Sequence[Lesson]) -> Lesson:
    return Lesson(**{one.name: torch.cat([getattr(lesson, one.name) for lesson in lessons]) for one in fields(Lesson)})


def as_legal(actions: NDArray[np.int8], legal: NDArray[np.uint8]) -> NDArray[np.int8]:
    """Return actions with those that cannot be done as STAY: what a script orders against a wall it means as staying."""
    is_legal = np.take_along_axis(legal, actions[..., None].astype(np.int64), 2)[..., 0]
    return np.where(is_legal, actions, Action.STAY).astype(np.int8)


def collect_lesson(
    seats: LearnerSeats, teacher: Teacher, network: TeamNetwork, n_ticks: int, own: float, rng: np.random.Generator
) -> Lesson:
    """Play `n_ticks` in every row, a share `own` of the seats by the learner."""
    n_seats, n_units, side = seats.n_seats, seats.n_units, seats.env.ruleset.side
    planes = np.zeros((n_ticks, n_seats, side, side, N_PLANES), np.uint8)
    scalars = np.zeros((n_ticks, n_seats, N_SCALARS), np.float32)
    cell = np.zeros((n_ticks, n_seats, n_units), np.int64)
    alive = np.zeros((n_ticks, n_seats, n_units), np.uint8)
    legal = np.zeros((n_ticks, n_seats, n_units, len(Action)), np.uint8)
    labels = np.zeros((n_ticks, n_seats, n_units), np.int64)
    actions = np.zeros((n_seats, n_units), np.int8)
    is_own = rng.random((n_seats, 1)) < own
    results = Results()
    for tick in range(n_ticks):
        seen = seats.env.observe()
        encoded, seeds = seats.look(seen)
        planes[tick], scalars[tick], cell[tick], alive[tick], legal[tick] = encoded
        taught = teacher.label(seen)
        if own:
            choose(infer(network, encoded, seats.n_walkers), seeds, actions)
        taught = as_legal(taught, encoded.legal)
        labels[tick] = np.where(encoded.alive, taught, _NO_LABEL)
        done = np.where(is_own, actions, taught)
        teacher.hear(done)
        turn = seats.step(seen, done, results)
        seats.earn(turn)  # nobody learns from it here, but matches go on into the rollouts, which count from this score
        teacher.start(turn)
    flat = (torch.from_numpy(one).flatten(0, 1) for one in (planes, scalars, cell, legal, labels))
    return Lesson(**dict(zip(("planes", "scalars", "cell", "legal", "labels"), flat, strict=True)))


def learn_lesson(learner: Learner, lesson: Lesson, n_walkers: int, rate: float, generator: torch.Generator) -> dict[str, float]:
    """Go through a lesson once; return the mean cross entropy, and how often the learner's likeliest action is the script's."""
    for group in learner.optimiser.param_groups:
        group["lr"] = rate
    sums, norm = torch.zeros(2, device=learner.device), 0.0
    whole = [one.to(learner.device) for one in (lesson.planes, lesson.scalars, lesson.cell, lesson.legal, lesson.labels)]
    n_steps = 0
    for rows in learner.minibatches(len(lesson.labels), learner.settings.clone_minibatch, generator):
        learner.optimiser.zero_grad(set_to_none=True)
        batch = [one[rows.to(learner.device)] for one in whole]
        for chunk in zip(*(torch.split(one, learner.chunk) for one in batch), strict=True):
            planes, scalars, cell, legal, labels = chunk
            with autocast(learner.device.type, learner.precision):
                logits = learner.network(planes, scalars, cell, legal, n_walkers)
            loss = functional.cross_entropy(logits.flatten(0, 1), labels.flatten(), ignore_index=_NO_LABEL)
            share = len(planes) / len(rows)
            (loss * share).backward()  # type: ignore[no-untyped-call]
            is_known = labels != _NO_LABEL
            agreed = ((logits.argmax(-1) == labels) & is_known).sum() / is_known.sum().clamp_min(1)
            sums += torch.stack([loss.detach(), agreed]) * share
        norm += learner.step()["actor_norm"]
        n_steps += 1
    loss, agreed = (learner.processes.mean(sums.cpu()) / n_steps).tolist()
    return {"clone_loss": loss, "agreed": agreed, "actor_norm": norm / n_steps}


def clone(
    actors: Actors,
    teachers: Sequence[Teacher],
    learner: Learner,
    progress: float,
    rng: np.random.Generator,
    generator: torch.Generator,
) -> tuple[int, dict[str, float]]:
    """Attend and study one lesson; return its samples, and how it went.

    Parameters
    ----------
    teachers
        One for each group of seats.
    progress
        From 0 to 1 in the course of cloning.
    """
    settings = learner.settings
    own = OWN_SEATS if progress > WATCHING else 0.0
    network, rngs = learner.to_act(), rng.spawn(len(teachers))
    lesson = _join(actors.in_each(
        lambda group: collect_lesson(actors.groups[group], teachers[group], network, settings.horizon, own, rngs[group])
    ))  # fmt: skip
    rate = settings.clone_rate * min(1.0, 0.1 + 10 * progress) * max(1 - progress, 0.05)
    return len(lesson.labels), learn_lesson(learner, lesson, actors.n_walkers, rate, generator)
