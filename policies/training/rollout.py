"""Play some ticks of many matches with the learner in its seats, and keep what it saw, did and earned.

The learner plays blue in every row, and red too in rows of self-play. Colours are no loss of generality: planes know only own and
enemy, and the frame is turned so that the enemy is always in the east.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from arena.envs.batched import BatchedEnv, StepResult
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team, Termination
from policies.networks.features import N_PLANES, N_SCALARS, Encoded, Encoder
from policies.networks.judges import N_TRUTH_PLANES
from policies.networks.learned import choose, infer
from policies.networks.models import TeamNetwork
from policies.training.opponents import SELF, Opponents
from policies.training.truth import reveal

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experience:
    """A rollout; t ticks of s seats. Actions and cells are those of the frame."""

    planes: Tensor
    """uint8, shape (t, s, side, side, N_PLANES)."""
    truth: Tensor
    """uint8, shape (t + 1, s, side, side, N_TRUTH_PLANES)."""
    scalars: Tensor
    """float32, shape (t, s, N_SCALARS)."""
    cell: Tensor
    """int64, shape (t, s, units)."""
    alive: Tensor
    """uint8, shape (t, s, units)."""
    legal: Tensor
    """uint8, shape (t, s, units, actions)."""
    actions: Tensor
    """int64, shape (t, s, units)."""
    logp: Tensor
    """float32, shape (t, s, units): log-probability of each action when it was drawn."""
    reward: Tensor
    """float32, shape (t, s): 1 for a match won, -1 for one lost; without shaping."""
    gain: Tensor
    """float32, shape (t, s): by how much the score rose, in hundredths; captures and eliminations left to `reward`."""
    has_ended: Tensor
    """bool, shape (t, s)."""
    last: tuple[Tensor, Tensor]
    """Planes and scalars after the last tick, for the value of what is to come."""

    def on(self, device: torch.device) -> "Experience":
        """Return the rollout on a device; where it is there already, itself."""
        moved = {name: getattr(self, name).to(device, non_blocking=True) for name in _STACKED}
        planes, scalars = self.last
        return Experience(**moved, last=(planes.to(device), scalars.to(device)))


_STACKED = tuple(one.name for one in fields(Experience) if one.name != "last")
"""Fields whose second axis is that of the seats."""


@dataclass(slots=True)
class Results:
    """How the matches that ended went for blue, by opponent: 1 for a win, 0.5 for a draw."""

    points: dict[str, list[float]] = field(default_factory=dict)
    ticks: list[int] = field(default_factory=list)

    def note(self, name: str, turn: StepResult, rows: NDArray[np.intp]) -> None:
        """Take in what ended in an opponent's rows."""
        mine = self.points.setdefault(name, [])
        for row in rows[turn.has_ended[rows]].tolist():
            winner = int(turn.winner[row])
            mine.append(0.5 if winner < 0 else float(winner == Team.BLUE))
            self.ticks.append(int(turn.ticks[row]))

    def add(self, other: "Results") -> None:
        """Take in the results of other rows."""
        for name, points in other.points.items():
            self.points.setdefault(name, []).extend(points)
        self.ticks.extend(other.ticks)


class LearnerSeats:
    """The learner in its seats: blue's of all rows, then red's of the rows of self-play."""

    def __init__(self, env: BatchedEnv, opponents: Opponents) -> None:
        ruleset: Ruleset = env.ruleset
        self.env, self.opponents = env, opponents
        n_red = len(opponents.self_rows)
        self.n_seats = env.n_games + n_red
        self.n_walkers = sum(not unit.flies for unit in ruleset.team(Team.BLUE))
        self.n_units = len(ruleset.team(Team.BLUE))
        self._blue = Encoder(ruleset, Team.BLUE, env.n_games)
        self._red = Encoder(ruleset, Team.RED, n_red) if n_red else None
        self._orders = {team: np.zeros((env.n_games, len(ruleset.team(team))), np.int8) for team in Team}
        self._score = np.zeros(env.n_games, np.int32)

    def look(self, seen: dict[Team, Observations]) -> tuple[Encoded, NDArray[np.uint64]]:
        """Return all seats encoded, blue's first, and each one's seed."""
        blue = self._blue.encode(seen[Team.BLUE])
        if self._red is None:
            return blue, np.ascontiguousarray(seen[Team.BLUE].seed)
        rows = seen[Team.RED].select(self.opponents.self_rows)
        red = self._red.encode(rows)
        return Encoded(*(np.concatenate([one, other]) for one, other in zip(blue, red, strict=True))), np.concatenate(
            [seen[Team.BLUE].seed, rows.seed]
        )

    def reveal(self, planes: NDArray[np.uint8]) -> None:
        """Write the true planes of every seat; uint8, shape (s, side, side, N_TRUTH_PLANES)."""
        n_games = self.env.n_games
        reveal(self.env.games, Team.BLUE, self._blue.is_turned, planes[:n_games])
        if self._red is not None:
            is_turned = np.zeros(n_games, np.bool_)
            is_turned[self.opponents.self_rows] = self._red.is_turned
            whole = np.zeros((n_games, *planes.shape[1:]), np.uint8)
            reveal(self.env.games, Team.RED, is_turned, whole)
            planes[n_games:] = whole[self.opponents.self_rows]

    def step(self, seen: dict[Team, Observations], actions: NDArray[np.int8], results: Results) -> StepResult:
        """Step with the learner's `actions`, of the frame, shape (s, units), and the opponents' own."""
        n_games, rows = self.env.n_games, self.opponents.self_rows
        self._orders[Team.BLUE][:] = self._blue.to_board(actions[:n_games])
        self.opponents.act(seen[Team.RED], self._orders[Team.RED])
        if self._red is not None:
            self._orders[Team.RED][rows] = self._red.to_board(actions[n_games:])
        turn = self.env.step(self._orders)
        self._blue.start(np.flatnonzero(turn.has_ended))
        if self._red is not None:
            self._red.start(np.flatnonzero(turn.has_ended[rows]))
        self.opponents.start(turn)
        for name, mine in self.opponents.rows.items():
            results.note(name, turn, mine)
        if len(rows):
            results.note(SELF, turn, rows)
        return turn

    def to_frame(self, orders: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return orders on the board, of all seats, as actions of each one's frame; shape (s, units)."""
        n_games = self.env.n_games
        parts = [self._blue.to_board(orders[:n_games])]
        if self._red is not None:
            parts.append(self._red.to_board(orders[n_games:]))
        return np.concatenate(parts)

    def earn(self, turn: StepResult) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Return reward, gain and end of each seat, as `Experience` has them."""
        outcome = np.where(turn.winner == Team.BLUE, 1.0, np.where(turn.winner == Team.RED, -1.0, 0.0))
        reward = np.where(turn.has_ended, outcome, 0.0).astype(np.float32)
        is_decided = (turn.ending == Termination.CAPTURE) | (turn.ending == Termination.ELIMINATION)
        gain = np.where(is_decided, 0.0, (turn.score - self._score) / 100).astype(np.float32)
        self._score = np.where(turn.has_ended, 0, turn.score)
        rows = self.opponents.self_rows
        return (
            np.concatenate([reward, -reward[rows]]),
            np.concatenate([gain, -gain[rows]]),
            np.concatenate([turn.has_ended, turn.has_ended[rows]]),
        )


def join(parts: Sequence[Experience], *, is_pinned: bool = False) -> Experience:
    """Return the rollouts of several groups of seats as one.

    Parameters
    ----------
    is_pinned
        Whether it is to lie in memory that a GPU reads by itself, which a system without one does not have.
    """
    if len(parts) == 1 and not is_pinned:
        return parts[0]
    joined = {name: _side_by_side([getattr(part, name) for part in parts], is_pinned) for name in _STACKED}
    planes, scalars = zip(*(part.last for part in parts), strict=True)
    return Experience(**joined, last=(torch.cat(planes), torch.cat(scalars)))


def _side_by_side(parts: Sequence[Tensor], is_pinned: bool) -> Tensor:
    n_ticks, n_seats = len(parts[0]), sum(part.shape[1] for part in parts)
    whole = torch.empty((n_ticks, n_seats, *parts[0].shape[2:]), dtype=parts[0].dtype, pin_memory=is_pinned)
    return torch.cat(list(parts), 1, out=whole)


class Actors:
    """The learner's seats in groups of rows. Each group has a thread, so that cores play while others wait for the network.

    The kernels of the game and of the scripts run without the interpreter's lock, and so does the network.

    Parameters
    ----------
    is_pinned
        Whether rollouts are for a GPU, see `join`.
    """

    def __init__(self, groups: Sequence[LearnerSeats], *, is_pinned: bool = False) -> None:
        self.groups, self._is_pinned = list(groups), is_pinned
        self._pool = ThreadPoolExecutor(len(self.groups), thread_name_prefix="actor") if len(self.groups) > 1 else None

    @property
    def n_walkers(self) -> int:
        """Units of a seat that walk."""
        return self.groups[0].n_walkers

    def in_each(self, play: Callable[[int], T]) -> list[T]:
        """Return what came of playing in each group, by its index; all at once."""
        return list((self._pool.map if self._pool else map)(play, range(len(self.groups))))

    def collect(self, network: TeamNetwork, n_ticks: int, results: Results) -> Experience:
        """Play `n_ticks` in every row of every group."""
        apart = [Results() for _ in self.groups]
        parts = self.in_each(lambda group: collect(self.groups[group], network, n_ticks, apart[group]))
        for one in apart:
            results.add(one)
        return join(parts, is_pinned=self._is_pinned)

    def use(self, name: str, weights: Mapping[str, Tensor], network: TeamNetwork) -> None:
        """Let `best` or `past` play with other weights."""
        for seats in self.groups:
            seats.opponents.use(name, weights, network)


def collect(seats: LearnerSeats, network: TeamNetwork, n_ticks: int, results: Results) -> Experience:
    """Play `n_ticks` in every row."""
    n_seats, n_units, side = seats.n_seats, seats.n_units, seats.env.ruleset.side
    planes = np.zeros((n_ticks, n_seats, side, side, N_PLANES), np.uint8)
    truth = np.zeros((n_ticks + 1, n_seats, side, side, N_TRUTH_PLANES), np.uint8)
    scalars = np.zeros((n_ticks, n_seats, N_SCALARS), np.float32)
    cell = np.zeros((n_ticks, n_seats, n_units), np.int64)
    alive = np.zeros((n_ticks, n_seats, n_units), np.uint8)
    legal = np.zeros((n_ticks, n_seats, n_units, len(Action)), np.uint8)
    actions = np.zeros((n_ticks, n_seats, n_units), np.int8)
    logp = np.zeros((n_ticks, n_seats, n_units), np.float32)
    reward, gain = np.zeros((2, n_ticks, n_seats), np.float32)
    has_ended = np.zeros((n_ticks, n_seats), np.bool_)
    for tick in range(n_ticks):
        seen = seats.env.observe()
        encoded, seeds = seats.look(seen)
        planes[tick], scalars[tick], cell[tick], alive[tick], legal[tick] = encoded
        seats.reveal(truth[tick])
        logits = infer(network, encoded, seats.n_walkers)
        choose(logits, seeds, actions[tick])
        chosen = torch.from_numpy(actions[tick].astype(np.int64))[..., None]
        logp[tick] = torch.from_numpy(logits).log_softmax(-1).gather(-1, chosen).squeeze(-1).numpy()
        reward[tick], gain[tick], has_ended[tick] = seats.earn(seats.step(seen, actions[tick], results))
    encoded, _ = seats.look(seats.env.observe())
    seats.reveal(truth[n_ticks])
    return Experience(
        planes=torch.from_numpy(planes), truth=torch.from_numpy(truth), scalars=torch.from_numpy(scalars),
        cell=torch.from_numpy(cell), alive=torch.from_numpy(alive), legal=torch.from_numpy(legal),
        actions=torch.from_numpy(actions.astype(np.int64)), logp=torch.from_numpy(logp),
        reward=torch.from_numpy(reward), gain=torch.from_numpy(gain), has_ended=torch.from_numpy(has_ended),
        last=(torch.from_numpy(encoded.planes.copy()), torch.from_numpy(encoded.scalars.copy())),
    )  # fmt: skip
