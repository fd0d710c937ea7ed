"""Whom the learner meets: itself, its former selves, and scripts; and when a newer self takes the place of the best."""

import logging
import math
from collections import deque
from collections.abc import Iterable, Mapping
from copy import deepcopy

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from arena.envs.batched import StepResult
from arena.errors import InputError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team, Termination
from arena.intervals import margin_of
from arena.policy import BatchPolicy, MatchResult
from policies.networks.learned import LearnedTeam
from policies.networks.models import TeamNetwork
from policies.registry import load

logger = logging.getLogger(__name__)

SELF, BEST, PAST, NOBODY = "self", "best", "past", "nobody"
_MOST_PAST = 20
"""Former selves that are kept; with one more, the second oldest goes, and the start stays."""
_LEAST_WEIGHT = 0.05
_LEAST_NEWEST, _MOST_NEWEST = 40, 400
"""Matches from which on a score has an interval, and as many as it is of."""


def assign(shares: Mapping[str, float], first_row: int, n_rows: int) -> dict[str, NDArray[np.intp]]:
    """Return each opponent's rows, counted from `first_row`.

    Row by row, the opponent that is furthest behind its share gets the row. Who is met in a row does not depend on how many
    processes share the rows.
    """
    names, total = sorted(shares), sum(shares.values())
    given = dict.fromkeys(names, 0)
    rows: dict[str, list[int]] = {name: [] for name in names}
    for row in range(first_row + n_rows):
        name = max(names, key=lambda one: shares[one] / total * (row + 1) - given[one])
        given[name] += 1
        if row >= first_row:
            rows[name].append(row - first_row)
    return {name: np.array(mine, np.intp) for name, mine in rows.items() if mine}


def prioritise(shares: Mapping[str, float], scores: Mapping[str, float], power: float) -> dict[str, float]:
    """Return shares in which scripts that beat the learner have more of what all scripts have together.

    Source: prioritised fictitious self-play of Vinyals et al., "Grandmaster level in StarCraft II" (2019): the weight of an
    opponent is (1 - score)^power. A little is added, so that nobody is forgotten.

    Parameters
    ----------
    scores
        The learner's against each; 0.5 where there is none.
    power
        0 leaves the shares as they are.
    """
    scripts = [name for name in shares if name not in (SELF, BEST, PAST)]
    weights = {name: shares[name] * ((1 - scores.get(name, 0.5)) ** power + _LEAST_WEIGHT) for name in scripts}
    by = sum(shares[name] for name in scripts) / max(sum(weights.values()), 1e-9)
    return {name: weights[name] * by if name in weights else share for name, share in shares.items()}


def check_learner(ruleset: Ruleset, shares: Mapping[str, float]) -> None:
    """Refuse a ruleset under which the learner has nothing to play, or cannot play itself as its share of the matches asks.

    Raises
    ------
    InputError
        Blue, which the learner plays in every row, has no units; or it meets itself, and a team has other units than the other.
    """
    blue, red = (ruleset.team(team) for team in Team)
    if not blue:
        raise InputError(f"ruleset {ruleset.name}: blue has no units to train")
    if red and shares.get(SELF) and [unit.flies for unit in blue] != [unit.flies for unit in red]:
        raise InputError(
            f"ruleset {ruleset.name}: the teams have other units, so one network cannot play both; give --set opponents.{SELF}=0"
        )


class Newest:
    """The learner's newest results against one opponent: their mean, and the interval in which the true score lies with 95%."""

    def __init__(self, points: Iterable[float] = ()) -> None:
        self.points: deque[float] = deque(points, maxlen=_MOST_NEWEST)

    def interval(self) -> tuple[float, float, float]:
        """Return mean, lower and upper bound; NaN where there are too few."""
        if len(self.points) < _LEAST_NEWEST:
            return math.nan, math.nan, math.nan
        mean, margin = float(np.mean(self.points)), margin_of(list(self.points))
        assert margin is not None  # there are more than two
        return mean, max(mean - margin, 0.0), min(mean + margin, 1.0)


class Pool:
    """Former selves: weights, and how the learner fared against them.

    The last is the best so far: the learner plays against it until it has passed the gate.
    """

    def __init__(self, start: Mapping[str, Tensor], *, gate_matches: int, gate_score: float) -> None:
        self._gate_matches, self._gate_score = gate_matches, gate_score
        self.selves: list[dict[str, Tensor]] = [_copy(start)]
        self.points: list[float] = [0.5]
        """The learner's running score against each."""
        self.recent: deque[float] = deque(maxlen=gate_matches)
        """Points of the learner's last matches against the best."""

    @property
    def start(self) -> dict[str, Tensor]:
        """Weights that PPO began with, which are never dropped."""
        return self.selves[0]

    @property
    def best(self) -> dict[str, Tensor]:
        """Weights of the last self that passed the gate."""
        return self.selves[-1]

    def note_best(self, points: list[float]) -> None:
        """Take in results against the best: 1, 0.5 or 0 each."""
        self.recent.extend(points)
        for point in points:
            self.points[-1] += 0.02 * (point - self.points[-1])

    def note_past(self, index: int, points: list[float]) -> None:
        """Take in results against a former self."""
        for point in points:
            self.points[index] += 0.02 * (point - self.points[index])

    def try_gate(self, weights: Mapping[str, Tensor]) -> bool:
        """Make the learner the best, if it has passed the gate."""
        if len(self.recent) < self._gate_matches or sum(self.recent) < self._gate_score * len(self.recent):
            return False
        self.selves.append(_copy(weights))
        self.points.append(0.5)
        self.recent.clear()
        if len(self.selves) > _MOST_PAST:
            del self.selves[1], self.points[1]
        return True

    def draw_past(self, rng: np.random.Generator) -> int:
        """Return a former self, the more likely the better it does against the learner."""
        hardness = np.array([(1 - points) ** 2 + 0.01 for points in self.points])
        return int(rng.choice(len(hardness), p=hardness / hardness.sum()))


class Seated:
    """A fighter in some rows, which is told how each match ended, and whose mistakes are told once each.

    Parameters
    ----------
    rows
        The row that each of its seats is in.
    """

    def __init__(self, name: str, fighter: BatchPolicy, rows: NDArray[np.intp]) -> None:
        self.name, self.fighter, self.rows = name, fighter, rows
        self._hears_ends = type(fighter).end is not BatchPolicy.end
        self._may_fail = type(fighter).take_faults is not BatchPolicy.take_faults
        self._told: set[str] = set()

    def start(self, turn: StepResult) -> None:
        """Start a new match where the tick ended one."""
        seats = np.flatnonzero(turn.has_ended[self.rows])
        for seat in seats.tolist() if self._hears_ends else ():
            self.fighter.end(seat, _result_of(turn, self.rows[seat]).seen_by(self.fighter.team))
        for seat in seats.tolist() if self._may_fail else ():
            for kind, (sentence, _) in self.fighter.take_faults(seat).reasons.items():
                if kind not in self._told:
                    self._told.add(kind)
                    logger.warning("%s: %s", self.name, sentence)
        self.fighter.start(seats)


def _result_of(turn: StepResult, row: int) -> MatchResult:
    winner = int(turn.winner[row])
    return MatchResult(
        ending=Termination(int(turn.ending[row])), winner=None if winner < 0 else Team(winner), score=int(turn.score[row]),
        ticks=int(turn.ticks[row]),
    )  # fmt: skip


class Opponents:
    """All fighters on the red side of a batch of rows, except where the learner plays itself, or red has no units."""

    def __init__(self, ruleset: Ruleset, shares: Mapping[str, float], first_row: int, n_rows: int, network: TeamNetwork) -> None:
        self.rows = assign(shares if ruleset.team(Team.RED) else {NOBODY: 1.0}, first_row, n_rows)
        self.self_rows = self.rows.pop(SELF, np.zeros(0, np.intp))
        self._seated: dict[str, Seated] = {}
        for name, rows in self.rows.items():
            if name == NOBODY:
                continue
            fighter: BatchPolicy
            if name in (BEST, PAST):
                fighter = LearnedTeam(ruleset, Team.RED, len(rows), network=deepcopy(network))
            else:
                fighter = load(name)(ruleset, Team.RED, len(rows))
            self._seated[name] = Seated(name, fighter, rows)
        self._orders = {name: np.zeros((len(rows), len(ruleset.team(Team.RED))), np.int8) for name, rows in self.rows.items()}

    def use(self, name: str, weights: Mapping[str, Tensor], network: TeamNetwork) -> None:
        """Let `best` or `past` play with other weights; `network` is of the same shape, and is copied."""
        one = self._seated.get(name)
        if one is not None and isinstance(one.fighter, LearnedTeam):
            changed = deepcopy(network)
            changed.load_state_dict(dict(weights))
            one.fighter.use(changed)

    def start(self, turn: StepResult) -> None:
        """Start a new match for those whose match has ended."""
        for one in self._seated.values():
            one.start(turn)

    def act(self, red: Observations, orders: NDArray[np.int8]) -> None:
        """Write the orders of all rows but those of self-play."""
        for name, one in self._seated.items():
            one.fighter.act(red.select(one.rows), self._orders[name])
            orders[one.rows] = np.maximum(self._orders[name], Action.STAY)  # who gives no orders stays


def _copy(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {name: tensor.detach().clone() for name, tensor in weights.items()}
